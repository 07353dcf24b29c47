// SPDX-License-Identifier: BSD-3-Clause
#include "stream/edge_difference.hpp"

#include <catch2/catch.hpp>
#include <string>

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr Duration told = milliseconds(3);

LineDelays opto() {
    LineDelays lines;
    lines.line = "Line1";
    lines.start = {microseconds(36), microseconds(9)};
    lines.end = {microseconds(12), microseconds(6)};
    return lines;
}

struct Bench {
    Bench() { edges.set_line_delays(opto()); }

    /// `surplus`: what its length, the delays taken off, exceeds the camera's account by.
    void frame(Duration surplus) {
        pairing::Exposure exposure;
        exposure.end = exposure.start + told + surplus;
        edges.paired(exposure, told);
    }

    EdgeDifference edges;
};

}  // namespace

TEST_CASE("edge_difference: measured against the camera's account, whatever was taken off") {
    Bench bench;
    CHECK(bench.edges.report().frames == 0);
    for (int i = 0; i < 40; ++i) bench.frame(microseconds(10 + i % 3));
    const EdgeReport report = bench.edges.report();
    CHECK(report.frames == 32);
    // The end is 24 us less late than the start, by the preset; 11 us more, as measured.
    CHECK(report.expected == microseconds(-24));
    CHECK(report.difference == microseconds(-13));
    CHECK(report.sigma > microseconds(15));
    CHECK(line_hint(report).empty());
}

TEST_CASE("edge_difference: single wrong accounts do not move it") {
    Bench bench;
    for (int i = 0; i < 32; ++i) bench.frame(i % 4 == 0 ? milliseconds(9) : microseconds(5));
    CHECK(bench.edges.report().difference == microseconds(-19));
}

TEST_CASE("edge_difference: a line that is slower than known is named, with load and polarity") {
    Bench bench;
    for (int i = 0; i < 7; ++i) bench.frame(microseconds(150));
    CHECK(line_hint(bench.edges.report()).empty());
    bench.frame(microseconds(150));
    const std::string hint = line_hint(bench.edges.report());
    for (const char* part : {"Line1", "126 us more", "-24", "load", "pull-up", "polarity"})
        CHECK_THAT(hint, Catch::Contains(part));
    bench.edges.set_line_delays(opto());
    CHECK(line_hint(bench.edges.report()).empty());
}
