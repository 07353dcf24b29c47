// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_board.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "led_bench.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;

namespace {

constexpr Duration frame_period = milliseconds(100);

Expected<LedPlace> find(LedBench& bench, int pictures, Duration exposure = milliseconds(1)) {
    LedSearch search;
    for (int i = 0; i < pictures; ++i)
        search.add(bench.picture(HostTime{1} + frame_period * i, exposure));
    return search.find("cam0");
}

void check_place(const LedPlace& place, const std::vector<double>& leds) {
    const bool swapped = leds[2] < leds[0];  // the left end is the first one
    const std::size_t first = swapped ? 2 : 0;
    const std::size_t last = swapped ? 0 : 2;
    INFO(place.x1 << " " << place.y1 << " " << place.x2 << " " << place.y2);
    CHECK(std::hypot(place.x1 - leds[first], place.y1 - leds[first + 1]) < 0.5);
    CHECK(std::hypot(place.x2 - leds[last], place.y2 - leds[last + 1]) < 0.5);
}

}  // namespace

TEST_CASE("led_board: it is found wherever it is, large or small, whatever moves behind it") {
    LedBenchSettings settings;
    settings.leds =
        GENERATE(std::vector<double>{40, 150, 280, 165}, std::vector<double>{250, 40, 60, 20},
                 std::vector<double>{100, 20, 130, 200}, std::vector<double>{40, 60, 130, 60});
    settings.rate_hz = GENERATE(1000.0, 970.0);
    LedBench bench(settings);
    const auto place = find(bench, 40);
    REQUIRE(place);
    check_place(*place, settings.leds);
}

TEST_CASE("led_board: it is found in a few pictures of a scene at rest") {
    LedBenchSettings settings;
    settings.moving = false;
    settings.noise = 4;
    LedBench bench(settings);
    const auto place = find(bench, 5);
    REQUIRE(place);
    check_place(*place, settings.leds);
}

TEST_CASE("led_board: where there is none, none is found, and the cure is reported") {
    LedBenchSettings settings;
    settings.leds = {-2000, -2000, -1000, -1000};
    settings.moving = GENERATE(true, false);
    LedBench bench(settings);
    const auto place = find(bench, 10);
    REQUIRE_FALSE(place);
    CHECK_THAT(place.error().message(), Catch::Contains("cam0") && Catch::Contains("10 pictures") &&
                                            Catch::Contains("--board cam0=X1,Y1,X2,Y2"));
    CHECK_FALSE(LedSearch().find("cam0"));
}

TEST_CASE("led_board: levels are the share of the exposure that each LED was on") {
    LedBenchSettings settings;
    LedBench bench(settings);
    const LedPlace place{40, 150, 280, 165};
    // From count 3 to count 4, a quarter of the exposure before it: the last striding LED, then the
    // first and bit 0.
    const LedPicture seen =
        measure_leds(bench.picture(HostTime{3'750'000}, milliseconds(1)), place);
    REQUIRE(seen.state == LedState::good);
    const LedLevels expected{0.75, 0, 0, 0.25, 0.75, 0, 0, 0};
    for (std::size_t i = 0; i < 8; ++i)
        CHECK(seen.levels.at(i) == Approx(expected.at(i)).margin(0.03));
}

TEST_CASE("led_board: LEDs that are saturated, or covered, are reported") {
    LedBenchSettings settings;
    settings.led_level = 400;
    LedBench bright(settings);
    const LedPlace place{40, 150, 280, 165};
    const LedPicture seen = measure_leds(bright.picture(HostTime{1}, milliseconds(1)), place);
    CHECK(seen.state == LedState::saturated);
    CHECK(seen.levels[0] == Approx(1).margin(0.05));
    settings.led_level = 20;  // as dark as the plate
    LedBench dark(settings);
    CHECK(measure_leds(dark.picture(HostTime{1}, milliseconds(1)), place).state ==
          LedState::hidden);
    CHECK(
        measure_leds(bright.picture(HostTime{2'000'000}, milliseconds(1)), {-90, 0, -9, 0}).state ==
        LedState::hidden);
}
