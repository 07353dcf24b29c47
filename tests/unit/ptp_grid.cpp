// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/ptp_grid.hpp"

#include <catch2/catch.hpp>
#include <random>

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr CameraTime about_now{1'795'983'837'000'000'000};

}  // namespace

TEST_CASE("ptp_grid: whole seconds are points of each whole rate") {
    for (const double rate_hz : {1.0, 7.0, 20.0, 30.0, 59.0, 120.0}) {
        const PtpGrid grid(rate_hz, {});
        const std::uint64_t k = grid.first(about_now);
        CHECK(grid.point(k) == about_now);
        CHECK(grid.tick(k) == static_cast<std::uint64_t>(about_now.ns / 1000));
    }
}

TEST_CASE("ptp_grid: points of two rates that coincide have one tick, whatever their phases") {
    const PtpGrid fast(60, microseconds(100));
    const PtpGrid slow(20, microseconds(7000));
    for (std::uint64_t i = 0; i < 1000; ++i) {
        const std::uint64_t k = slow.first(about_now) + i;
        CHECK(fast.tick(3 * k) == slow.tick(k));
        CHECK(slow.point(k) - fast.point(3 * k) == microseconds(6900));
    }
}

TEST_CASE("ptp_grid: the first point is not before, and the one before it is") {
    std::mt19937_64 random(7);
    for (int i = 0; i < 100'000; ++i) {
        const double rate_hz = std::uniform_real_distribution(0.1, 500.0)(random);
        const PtpGrid grid(rate_hz, microseconds(std::uniform_int_distribution(0, 2000)(random)));
        const CameraTime from{std::uniform_int_distribution<std::int64_t>(
            1'000'000'000, 4'000'000'000'000'000'000)(random)};
        const std::uint64_t k = grid.first(from);
        REQUIRE(grid.point(k) >= from);
        REQUIRE(grid.point(k - 1) < from);
    }
}

TEST_CASE("ptp_grid: there are no points before PTP's zero") {
    const PtpGrid grid(20, microseconds(7000));
    CHECK(grid.first({3}) == 0);
    CHECK(grid.first({-5'000'000'000}) == 0);
    CHECK(grid.first({8'000'000}) == 1);
}

TEST_CASE("ptp_grid: an odd rate does not drift from its fraction") {
    const PtpGrid grid(12.5, {});
    CHECK(grid.point(25'000'000'000) == CameraTime{2'000'000'000'000'000'000});
    const PtpGrid third(29.97, {});
    CHECK(third.point(2997'000'000) == CameraTime{100'000'000'000'000'000});
}
