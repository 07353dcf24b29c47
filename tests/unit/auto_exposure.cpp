// SPDX-License-Identifier: BSD-3-Clause
#include "camera/auto_exposure.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

#include "pixel_formats.hpp"

using namespace versavis;
using namespace versavis::daemon;
using namespace versavis::test;

namespace {

std::vector<std::byte> plain_pixels(std::size_t pixels, unsigned value) {
    return std::vector<std::byte>(pixels, static_cast<std::byte>(value));
}

AutoExposureConfiguration exposure_settings() {
    AutoExposureConfiguration settings;
    settings.enabled = true;
    settings.max_us = 20'000;
    return settings;
}

}  // namespace

TEST_CASE("auto_exposure: brightness is the mean, or a percentile, of pixels of 8 to 16 bits") {
    auto pixels = plain_pixels(640 * 480, 51);
    CHECK(brightness({pixels, 640, 480, mono8}, 0) == Approx(0.2));
    std::fill(pixels.begin(), pixels.begin() + 640 * 240, std::byte{255});
    CHECK(brightness({pixels, 640, 480, mono8}, 0) == Approx(0.6).margin(0.02));
    CHECK(brightness({pixels, 640, 480, mono8}, 90) == Approx(1));
    CHECK(brightness({pixels, 640, 480, mono8}, 10) == Approx(0.2));

    std::vector<std::uint16_t> words(64 * 48, 2048);
    std::vector<std::byte> bytes(words.size() * 2);
    std::memcpy(bytes.data(), words.data(), bytes.size());
    CHECK(brightness({bytes, 64, 48, mono12}, 0) == Approx(2048 / 4095.0));
}

TEST_CASE("auto_exposure: what cannot be metered is not guessed") {
    const auto pixels = plain_pixels(100, 51);
    CHECK_FALSE(brightness({pixels, 10, 10, mono12_packed}, 0));
    CHECK_FALSE(brightness({pixels, 10, 11, mono8}, 0));  // more rows than bytes
    CHECK_FALSE(brightness({pixels, 0, 10, mono8}, 0));
    FrameMeter meter(0);
    meter.take({pixels, 10, 10, mono12_packed}, HostTime{5});
    CHECK_FALSE(meter.usable());
}

TEST_CASE("auto_exposure: a frame is used once, and only if it was exposed as asked") {
    const auto pixels = plain_pixels(100, 255);
    FrameMeter meter(0);
    meter.take({pixels, 10, 10, mono8}, HostTime{5});
    CHECK_FALSE(meter.newest(HostTime{5}));
    CHECK(meter.newest(HostTime{4}) == Approx(1));
    CHECK_FALSE(meter.newest(HostTime{4}));
}

TEST_CASE("auto_exposure: it settles at the target, from below and above, within its limits") {
    const double light = GENERATE(0.00002, 0.0002, 0.002);  // brightness per microsecond
    const Duration first = GENERATE(microseconds(50), milliseconds(20),
                                    milliseconds(100));  // the last is beyond the limits
    AutoExposure control(exposure_settings(), first);
    int changes = 0;
    for (int frame = 0; frame < 60; ++frame) {
        const double seen =
            std::min(1.0, light * static_cast<double>(control.exposure().ns) * 1e-3);
        const Duration before = control.exposure();
        const auto next = control.update(seen);
        if (!next) continue;
        ++changes;
        const double step = static_cast<double>(next->ns) / static_cast<double>(before.ns);
        CHECK(step <= 1.5001);
        CHECK((step >= 1 / 1.5001 || before > milliseconds(20)));
    }
    CHECK(light * static_cast<double>(control.exposure().ns) * 1e-3 == Approx(0.4).epsilon(0.05));
    CHECK(changes < 30);
    CHECK_FALSE(control.update(0.4));  // what is right is left alone
}

TEST_CASE("auto_exposure: black and saturated frames lead to the limits, not beyond") {
    AutoExposure control(exposure_settings(), milliseconds(1));
    for (int i = 0; i < 50; ++i) control.update(0);
    CHECK(control.exposure() == milliseconds(20));
    for (int i = 0; i < 50; ++i) control.update(1);
    CHECK(control.exposure() == microseconds(50));
}
