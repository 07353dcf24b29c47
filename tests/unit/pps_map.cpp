// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/pps_map.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace versavis;
using namespace versavis::clock;

namespace {

/// A board that runs fast by 30 ppm, and pulses that its input stamps within 50 ns.
struct Pulses {
    BoardTime board(std::int64_t second, std::int64_t ns = 0) const {
        const double elapsed = static_cast<double>(second) + static_cast<double>(ns) * 1e-9;
        return {5'000'000'000 + second * 1'000'000'000 + ns + std::llround(elapsed * 30e3)};
    }
    OutputTime time(std::int64_t second, std::int64_t ns = 0) const {
        return {(1'700'000'000 + second) * 1'000'000'000 + ns};
    }
    void give(PpsMap& map, std::int64_t first, std::int64_t last) {
        for (std::int64_t second = first; second < last; ++second)
            map.add(board(second) + Duration{std::llround(noise(random))}, time(second));
    }
    Duration error(const PpsMap& map, std::int64_t second, std::int64_t ns) const {
        return map.translate(board(second, ns)).value().time - time(second, ns);
    }

    std::mt19937_64 random{1};
    std::normal_distribution<> noise{0, 50};
};

}  // namespace

TEST_CASE("pps_map: a few pulses make it, then it is within their noise") {
    Pulses pulses;
    PpsMap map;
    pulses.give(map, 0, 3);
    CHECK_FALSE(map.translate(pulses.board(3)));
    CHECK_FALSE(map.healthy(pulses.board(3)));
    pulses.give(map, 3, 60);
    CHECK(map.healthy(pulses.board(60)));
    CHECK(absolute(pulses.error(map, 59, 500'000'000)) < nanoseconds(200));
    CHECK(map.translate(pulses.board(59))->sigma < nanoseconds(150));
    CHECK(map.rejected() == 0);
    CHECK(map.pulses() == 60);
}

TEST_CASE("pps_map: without pulses it is no longer healthy, then it ends") {
    Pulses pulses;
    PpsMap map;
    pulses.give(map, 0, 60);
    CHECK_FALSE(map.healthy(pulses.board(63)));
    CHECK(absolute(pulses.error(map, 100, 0)) < map.translate(pulses.board(100))->sigma * 4);
    CHECK(map.translate(pulses.board(100))->sigma > map.translate(pulses.board(60))->sigma);
    CHECK_FALSE(map.translate(pulses.board(120)));
}

TEST_CASE("pps_map: a false pulse is left out, a new series is taken") {
    Pulses pulses;
    PpsMap map;
    pulses.give(map, 0, 60);
    map.add(pulses.board(60, 40'000), pulses.time(60));
    CHECK(map.rejected() == 1);
    CHECK_FALSE(map.healthy(pulses.board(60, 50'000)));
    pulses.give(map, 61, 63);
    CHECK(map.healthy(pulses.board(63)));
    CHECK(absolute(pulses.error(map, 62, 0)) < nanoseconds(200));
    // Seconds are named anew: one later than before.
    for (std::int64_t second = 63; second < 72; ++second)
        map.add(pulses.board(second), pulses.time(second + 1));
    CHECK(map.rejected() == 4);
    CHECK(map.healthy(pulses.board(72)));
    CHECK(absolute(pulses.error(map, 71, 0) - seconds(1)) < nanoseconds(500));
    map.board_restarted();
    CHECK_FALSE(map.translate(pulses.board(72)));
}
