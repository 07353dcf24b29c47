// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_history.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;

namespace {

/// Exchanges with a board that runs 50 ppm slow; each delay is the longer, the later in a cycle.
ClockRecording recording(std::int64_t count, Duration interval = milliseconds(100)) {
    ClockRecording all;
    for (std::int64_t i = 0; i < count; ++i) {
        const std::int64_t t = i * interval.ns;
        const std::int64_t there = 100'000 + i % 7 * 10'000;
        const std::int64_t back = 100'000 + i % 5 * 10'000;
        const auto board = [](std::int64_t host) { return BoardTime{host - host / 20'000}; };
        all.messages.push_back(
            {{t + there + back},
             clock::Exchange{{t}, board(t + there), board(t + there), {t + there + back}}});
    }
    return all;
}

}  // namespace

TEST_CASE("clock_history: history has a point per exchange, with what it measured and changed") {
    const auto points =
        clock_history(recording(600, seconds(1)), *make_estimator(EstimatorKind::ekf_fair));
    REQUIRE(points.size() == 600);
    CHECK(points[0].time_s == 0);
    CHECK(points[0].residual_ns == 0);
    CHECK(points[599].time_s == Approx(599).margin(0.01));
    // Host minus board clock grows by 50 us a second.
    CHECK(points[599].offset_ns - points[499].offset_ns == Approx(5e6).epsilon(0.05));
    CHECK(points[599].skew_ppm == Approx(50).epsilon(0.05));
    // The published gain is the ratio of the two.
    CHECK(points[599].innovation_ns == Approx(0.0515 * points[599].residual_ns).margin(2));
}

TEST_CASE("clock_history: corrections by one-way messages count for the next exchange") {
    auto mixed = recording(2);
    const auto alone = clock_history(mixed, *make_estimator(EstimatorKind::envelope));
    mixed.messages.insert(mixed.messages.begin() + 1,
                          {{50'000'000}, clock::OneWay{{40'000'000}, {50'000'000}}});
    CHECK(clock_history(mixed, *make_estimator(EstimatorKind::envelope)).size() == alone.size());
}

TEST_CASE("clock_history: absurd stamps give numbers, too") {
    constexpr std::int64_t far = std::int64_t{1} << 60;
    ClockRecording all = recording(10);
    for (const std::int64_t h : {far, -far})
        all.messages.push_back({{h}, clock::Exchange{{h}, {-h}, {-h}, {h + 1000}}});
    for (const auto kind : {EstimatorKind::ekf, EstimatorKind::ekf_fair}) {
        const std::string csv = to_csv(clock_history(all, *make_estimator(kind)));
        CHECK_THAT(csv, Catch::StartsWith("time_s,offset_ns,") && !Contains("nan"));
        CHECK(std::count(csv.begin(), csv.end(), '\n') == 13);
    }
}
