// SPDX-License-Identifier: BSD-3-Clause
#include "plausibility/edge_difference.hpp"

#include <catch2/catch.hpp>
#include <string>

using namespace versavis;
using namespace versavis::daemon;

namespace {

LineDelays opto() {
    LineDelays lines;
    lines.line = "Line1";
    lines.start = {microseconds(36), microseconds(9)};
    lines.end = {microseconds(12), microseconds(6)};
    return lines;
}

struct DifferenceBench {
    DifferenceBench() { edges.set_line_delays(opto()); }

    void frames(int count, Duration surplus, Duration start_delay = microseconds(20)) {
        for (int i = 0; i < count; ++i) edges.learn(surplus, start_delay);
    }

    EdgeDifference edges;
};

}  // namespace

TEST_CASE("edge_difference: measured against the camera's account, whatever was taken off") {
    DifferenceBench bench;
    CHECK(bench.edges.report().frames == 0);
    for (int i = 0; i < 40; ++i) bench.frames(1, microseconds(10 + i % 3));
    const EdgeReport report = bench.edges.report();
    CHECK(report.frames == 32);
    // The end is 24 us less late than the start, by the preset; 11 us more, as measured.
    CHECK(report.expected == microseconds(-24));
    CHECK(report.difference == microseconds(-13));
    CHECK(report.sigma > microseconds(15));
    CHECK(report.correction.ns == 0);
    CHECK(line_hint(report).empty());
}

TEST_CASE("edge_difference: what honest frames agree on leaves little room for others") {
    DifferenceBench bench;
    // Three sigma of the delays and of the rounded account.
    CHECK(bench.edges.explains(microseconds(65)));
    CHECK_FALSE(bench.edges.explains(microseconds(72)));
    bench.frames(100, microseconds(5));
    CHECK(bench.edges.settled());
    CHECK(absolute(bench.edges.surplus() - microseconds(5)) <= microseconds(1));
    CHECK(bench.edges.explains(microseconds(14)));
    CHECK_FALSE(bench.edges.explains(microseconds(18)));
    CHECK(bench.edges.correction().sigma < microseconds(3));
}

TEST_CASE("edge_difference: single wrong lengths do not move it, however often they come") {
    DifferenceBench bench;
    bench.frames(8, microseconds(5));
    for (int i = 0; i < 200; ++i) bench.frames(1, i % 2 == 0 ? microseconds(500) : microseconds(5));
    CHECK(absolute(bench.edges.surplus() - microseconds(5)) <= microseconds(1));
    CHECK_FALSE(bench.edges.explains(microseconds(500)));
    CHECK(bench.edges.correction().middle().ns == 0);
}

TEST_CASE("edge_difference: lengths that do not agree with each other are learned by nobody") {
    DifferenceBench bench;
    for (int i = 0; i < 200; ++i) bench.frames(1, microseconds(300 + i * 37 % 700));
    CHECK(bench.edges.surplus().ns == 0);
    CHECK_FALSE(bench.edges.settled());
}

TEST_CASE("edge_difference: a slow end is taken off when eight frames agree, and named") {
    DifferenceBench bench;
    bench.frames(7, microseconds(400));
    CHECK_FALSE(bench.edges.explains(microseconds(400)));
    bench.frames(1, microseconds(400));
    CHECK(bench.edges.explains(microseconds(400)));
    const EdgeCorrection correction = bench.edges.correction();
    CHECK(correction.start.ns == 0);
    CHECK(correction.end == microseconds(400));
    CHECK(correction.middle() == microseconds(200));
    CHECK(correction.sigma >= microseconds(10));
    CHECK(correction.sigma < microseconds(20));
    const std::string hint = line_hint(bench.edges.report());
    for (const char* part :
         {"Line1", "376 us more", "-24", "load", "pull-up", "polarity", "taken off"})
        CHECK_THAT(hint, Catch::Contains(part));
    bench.edges.set_line_delays(opto());
    CHECK(line_hint(bench.edges.report()).empty());
    CHECK_FALSE(bench.edges.explains(microseconds(400)));
}

TEST_CASE("edge_difference: a start is late by no more than it comes after its trigger") {
    DifferenceBench late;
    late.frames(8, -microseconds(400), microseconds(420));
    CHECK(late.edges.correction().start == microseconds(400));
    CHECK(late.edges.correction().end.ns == 0);
    // A pulse of the camera's own length, which begins with the exposure.
    DifferenceBench other_signal;
    other_signal.frames(50, -microseconds(400), microseconds(20));
    CHECK_FALSE(other_signal.edges.explains(-microseconds(400)));
    CHECK(other_signal.edges.correction().middle().ns == 0);
}

TEST_CASE("edge_difference: no line is slower than a millisecond") {
    DifferenceBench bench;
    bench.frames(50, microseconds(1001), milliseconds(2));
    bench.frames(50, -microseconds(1001), milliseconds(2));
    CHECK_FALSE(bench.edges.settled());
    bench.frames(8, microseconds(999));
    CHECK(bench.edges.settled());
}
