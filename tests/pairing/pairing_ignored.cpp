// SPDX-License-Identifier: BSD-3-Clause
// Cameras that do not answer triggers one to one: each frame that can be proved is published.
#include <catch2/catch.hpp>

#include "campaign.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

/// A camera at 20 Hz without late frames.
WorldSettings steady(std::uint64_t seed) {
    WorldSettings settings;
    settings.seed = seed;
    settings.late_frames = 0;
    settings.ids_count_ignored = seed % 2 != 0;
    settings.stamped = static_cast<pairing::Instant>(1 + seed % 3);
    settings.wide_ids = seed % 5 < 2;
    settings.chunks = seed % 7 < 3;
    return settings;
}

double published_share(const Verdict& verdict) {
    return static_cast<double>(verdict.published) / static_cast<double>(verdict.frames);
}

}  // namespace

TEST_CASE("pairing_ignored: a camera that takes every n-th trigger delivers every frame") {
    for (const std::int64_t every : {2, 3, 4})
        for (std::uint64_t seed = 0; seed < 20; ++seed) {
            INFO("every " << every << ", seed " << seed);
            WorldSettings settings = steady(seed);
            settings.shortest_period = milliseconds(50 * every - 39);
            const Verdict verdict = run_world(settings);
            CHECK(verdict.wrong == 0);
            CHECK(published_share(verdict) > 0.97);
        }
}

TEST_CASE("pairing_ignored: triggers that a camera ignores at random cost no frame") {
    for (const double ignored : {0.05, 0.2, 0.5})
        for (std::uint64_t seed = 0; seed < 20; ++seed) {
            INFO("ignored " << ignored << ", seed " << seed);
            WorldSettings settings = steady(seed);
            settings.ignored = ignored;
            const Verdict verdict = run_world(settings);
            CHECK(verdict.wrong == 0);
            CHECK(published_share(verdict) > 0.97);
        }
}

TEST_CASE("pairing_ignored: a second frame of a trigger costs a few frames, and none is wrong") {
    for (const double doubled : {0.02, 0.2, 1.0})
        for (std::uint64_t seed = 0; seed < 20; ++seed) {
            INFO("doubled " << doubled << ", seed " << seed);
            WorldSettings settings = steady(seed);
            settings.doubled = doubled;
            const Verdict verdict = run_world(settings);
            CHECK(verdict.wrong == 0);
            if (doubled < 0.1) CHECK(published_share(verdict) > 0.85);
        }
}

TEST_CASE("pairing_ignored: faults of all kinds in cameras that answer unevenly") {
    for (const WorldClock clock : {WorldClock::good, WorldClock::absent})
        CHECK(run_random(1500, 1, clock, {}, Answers::unevenly).wrong == 0);
}

TEST_CASE("pairing_ignored: without an exposure line, ignored triggers make no wrong start") {
    // Where nobody sees them, frames may imitate another place of the pattern.
    for (const std::uint64_t seed :
         {40, 44, 104, 232, 248, 548, 652, 840, 876, 892, 1068, 1128, 1500})
        CHECK(run_random(1, seed, WorldClock::good, {}, Answers::unevenly).wrong == 0);
}

TEST_CASE("pairing_ignored: frames given up before their records come make no wrong start") {
    for (const std::uint64_t seed : {681, 1358})
        CHECK(run_random(1, seed, WorldClock::good, {}, Answers::unevenly).wrong == 0);
}

TEST_CASE("pairing_ignored: a board whose time steps ahead unseen does not hide the truth") {
    for (const std::uint64_t seed : {1787, 2301, 2353})
        CHECK(run_random(1, seed, WorldClock::good, {}, Answers::unevenly).wrong == 0);
}

TEST_CASE("pairing_ignored: a late frame of a clock that stepped ends no check") {
    CHECK(run_random(1, 1959, WorldClock::good, {}, Answers::unevenly).wrong == 0);
}
