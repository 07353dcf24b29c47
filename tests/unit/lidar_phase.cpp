// SPDX-License-Identifier: BSD-3-Clause
#include "lidar/lidar_phase.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <initializer_list>

using namespace versavis::client;

namespace {

/// Where the LiDAR looks `t_s` after a whole second.
double azimuth_at(const LidarRotation& rotation, double t_s) {
    const double turned = 360 * rotation.rate_hz * t_s;
    const double at = rotation.lock_azimuth + (rotation.counterclockwise ? -turned : turned);
    return at - 360 * std::floor(at / 360);
}

double apart(double a, double b) { return std::abs(std::remainder(a - b, 360)); }

}  // namespace

TEST_CASE("lidar_phase: one frame in each turn, or in each of some turns, sees what it looks at") {
    for (const bool counterclockwise : {false, true})
        for (const double lock : {0.0, 77.5, 359.9})
            for (const double azimuth : {0.0, 90.0, 180.0, -45.0, 719.0, 359.999})
                for (const double rate : {0.0, 1.0, 5.0, 10.0, 20.0, 30.0, 100.0}) {
                    const LidarRotation rotation{lock, 10, counterclockwise};
                    const auto phase = lidar_phase(rotation, azimuth, rate);
                    REQUIRE(phase);
                    const double period = 1 / (rate == 0 ? 10 : rate);
                    CAPTURE(counterclockwise, lock, azimuth, rate, phase->phase_us);
                    CHECK(phase->phase_us >= 0);
                    CHECK(phase->phase_us < period * 1e6 + 1e-3);
                    unsigned seen = 0;
                    const unsigned frames = phase->frames_per_turn;
                    for (unsigned frame = 0; frame < frames; ++frame)
                        if (apart(azimuth_at(rotation, phase->phase_us * 1e-6 + frame * period),
                                  azimuth) < 0.01)
                            ++seen;
                    CHECK(seen == 1);
                }
}

TEST_CASE("lidar_phase: rates that do not stay together are refused") {
    for (const double rate : {7.0, 15.0, 29.97, 3.0})
        CHECK_FALSE(lidar_phase({0, 10, false}, 0, rate));
    for (const double angle : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
        CHECK_FALSE(lidar_phase({0, 10, false}, angle, 0));
        CHECK_FALSE(lidar_phase({angle, 10, false}, 0, 0));
    }
    CHECK_FALSE(lidar_phase({0, 10, false}, 0, std::nan("")));
    for (const double rate : {2.0, 2.5, 10.0, 40.0}) CHECK(lidar_phase({0, 10, false}, 0, rate));
}
