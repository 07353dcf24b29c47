// SPDX-License-Identifier: BSD-3-Clause
// A camera that looks at the rig's LED timing board, without service and clocks.
#pragma once

#include <algorithm>
#include <cstring>

#include "camera_view.hpp"
#include "evaluate/grey_picture.hpp"
#include "versavis/metadata.hpp"

namespace versavis::test {

struct LedBenchSettings {
    std::vector<double> leds{40, 150, 280, 165};
    double rate_hz = 1000;
    double noise = 2;
    double led_level = 160;
    bool backward = false;
    bool high_bit_first = false;
    bool moving = true;
    double texture = 0;  ///< grey levels of a pattern that lies over everything, and stays
};

class LedBench {
 public:
    static constexpr std::uint32_t width = 320;
    static constexpr std::uint32_t height = 240;

    explicit LedBench(const LedBenchSettings& settings)
        : settings_(settings),
          scenario_(scenario(settings)),
          surroundings_(HostTime{0}, scenario_),
          view_(scenario_, scenario_.cameras[0], surroundings_) {}
    LedBench(const LedBench&) = delete;
    LedBench& operator=(const LedBench&) = delete;

    /// Pixels of an exposure, whose instants must not go back.
    std::vector<std::byte> pixels(HostTime start, Duration exposure) {
        const HostTime end = start + exposure;
        for (; step_time(steps_) <= end; ++steps_) surroundings_.leds->pulse(step_time(steps_));
        surroundings_.leds->settle(end);
        std::vector<std::uint8_t> out(std::size_t{width} * height);
        view_.paint(start, end, ++serial_, out);
        add_texture(out);
        std::vector<std::byte> bytes(out.size());
        std::memcpy(bytes.data(), out.data(), out.size());
        return bytes;
    }

    client::GreyPicture picture(HostTime start, Duration exposure) {
        return *client::grey_picture("cam", frame(exposure), pixels(start, exposure));
    }

    static FrameMetadata frame(Duration exposure) {
        FrameMetadata frame{};
        frame.width = frame.stride = width;
        frame.height = height;
        frame.pixel_format = 0x01080001;
        frame.exposure = exposure;
        return frame;
    }

    /// Steps at an instant.
    double phase(HostTime at) const {
        return static_cast<double>(at.ns) * 1e-9 * settings_.rate_hz;
    }

 private:
    /// Blocks of five pixels, each of a brightness of its own.
    void add_texture(std::vector<std::uint8_t>& out) const {
        if (settings_.texture <= 0) return;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const std::uint32_t hash =
                    (x / 5 * 73'856'093U ^ y / 5 * 19'349'663U) * 2654435761U;
                const double share = static_cast<double>(hash >> 24U) / 255;
                std::uint8_t& pixel = out[std::size_t{y} * width + x];
                pixel =
                    static_cast<std::uint8_t>(std::min(255.0, pixel + settings_.texture * share));
            }
    }

    /// The first step, to count 1, comes after one period.
    HostTime step_time(std::int64_t step) const {
        return HostTime{std::llround(static_cast<double>(step) * 1e9 / settings_.rate_hz)};
    }

    static rig::Scenario scenario(const LedBenchSettings& settings) {
        rig::CameraScenario camera;
        camera.width = width;
        camera.height = height;
        camera.blur_steps = 1;
        camera.leds = settings.leds;
        camera.noise = settings.noise;
        camera.led_level = settings.led_level;
        rig::Scenario scenario;
        scenario.motion.nods = false;
        if (!settings.moving) scenario.motion.rate_rad_s = {0, 0, 0};
        scenario.leds.present = true;
        scenario.leds.backward = settings.backward;
        scenario.leds.high_bit_first = settings.high_bit_first;
        scenario.cameras = {camera};
        return scenario;
    }

    LedBenchSettings settings_;
    rig::Scenario scenario_;
    rig::Surroundings surroundings_;
    rig::CameraView view_;
    std::int64_t steps_ = 1;
    std::uint64_t serial_ = 0;
};

}  // namespace versavis::test
