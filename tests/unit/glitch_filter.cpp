// SPDX-License-Identifier: BSD-3-Clause
#include "glitch_filter.hpp"

#include <catch2/catch.hpp>
#include <utility>
#include <vector>

using namespace versavis::firmware;

namespace {

/// A filter of 5 us, and what it let through.
struct Line {
    Line() { filter.configure(5'000); }

    void edge(Nanoseconds at, bool level) {
        settle(at);
        filter.edge(at, level);
    }
    void settle(Nanoseconds settled) {
        Nanoseconds at = 0;
        bool level = false;
        while (filter.take(settled, at, level)) edges.emplace_back(at, level);
    }

    GlitchFilter filter;
    std::vector<std::pair<Nanoseconds, bool>> edges;
};

using FilteredEdges = std::vector<std::pair<Nanoseconds, bool>>;

}  // namespace

TEST_CASE("glitch_filter: clean edges count from their own instants, once they have lasted") {
    Line line;
    line.edge(1'000, true);
    CHECK(line.filter.next_wake() == 6'000);
    CHECK(line.filter.settled(10'000) == 1'000);
    line.settle(5'999);
    CHECK(line.edges.empty());
    line.settle(6'000);
    CHECK(line.edges == FilteredEdges{{1'000, true}});
    CHECK(line.filter.next_wake() == never);
    CHECK(line.filter.settled(10'000) == 10'000);
    line.edge(20'000, false);
    line.settle(25'000);
    CHECK(line.edges == FilteredEdges{{1'000, true}, {20'000, false}});
    CHECK(line.filter.take_left_out() == 0);
}

TEST_CASE("glitch_filter: a line that bounces changes with its first edge") {
    Line line;
    line.edge(1'000, true);
    line.edge(1'200, false);
    line.edge(3'000, true);
    line.edge(7'000, false);
    line.edge(7'100, true);
    line.settle(12'099);
    CHECK(line.edges.empty());
    line.settle(12'100);
    CHECK(line.edges == FilteredEdges{{1'000, true}});
    CHECK(line.filter.take_left_out() == 4);
    CHECK(line.filter.take_left_out() == 0);
}

TEST_CASE("glitch_filter: a level that does not last is left out, on an idle line and an active") {
    Line line;
    line.edge(1'000, true);
    line.edge(5'999, false);
    line.settle(11'000);
    CHECK(line.edges.empty());
    CHECK(line.filter.take_left_out() == 2);
    line.edge(20'000, true);
    line.edge(30'000, false);
    line.edge(30'100, true);
    line.edge(40'000, false);
    line.settle(45'000);
    CHECK(line.edges == FilteredEdges{{20'000, true}, {40'000, false}});
    CHECK(line.filter.take_left_out() == 2);
}

TEST_CASE("glitch_filter: after a missed edge the next one counts, whatever its level") {
    Line line;
    line.edge(1'000, true);
    line.edge(20'000, true);
    line.settle(30'000);
    CHECK(line.edges == FilteredEdges{{1'000, true}, {20'000, true}});
    line.edge(40'000, false);
    line.filter.edges_lost();
    line.settle(50'000);
    CHECK(line.edges.size() == 2);
}

TEST_CASE("glitch_filter: the first level after lost edges does not count, but is known") {
    for (const bool first : {false, true}) {
        Line line;
        line.edge(1'000, true);
        line.settle(10'000);
        line.filter.edges_lost();
        line.edge(20'000, first);
        line.edge(22'000, !first);
        line.edge(24'000, first);
        line.settle(30'000);
        CHECK(line.edges == FilteredEdges{{1'000, true}});
        line.edge(40'000, !first);
        line.settle(50'000);
        CHECK(line.edges == FilteredEdges{{1'000, true}, {40'000, !first}});
    }
}

TEST_CASE("glitch_filter: configured anew, it forgets what was pending") {
    Line line;
    line.edge(1'000, true);
    line.edge(2'000, false);
    line.filter.configure(7'000);
    CHECK(line.filter.next_wake() == never);
    CHECK(line.filter.settled(10'000) == 10'000);
    CHECK(line.filter.take_left_out() == 0);
    line.edge(20'000, false);
    CHECK(line.filter.next_wake() == 27'000);
    line.settle(27'000);
    CHECK(line.edges == FilteredEdges{{20'000, false}});
}

TEST_CASE("glitch_filter: what is left out is counted, an edge from rest always may count") {
    Line line;
    line.edge(0, true);
    line.edge(1'000, true);  // the fall in between was missed
    line.settle(6'000);
    CHECK(line.edges == FilteredEdges{{0, true}});
    CHECK(line.filter.take_left_out() == 1);
    line.edge(20'000, true);
    line.edge(21'000, false);
    line.settle(30'000);
    CHECK(line.edges.size() == 1);
    CHECK(line.filter.take_left_out() == 2);
}
