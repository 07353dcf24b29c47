// SPDX-License-Identifier: BSD-3-Clause
#include "imu/ready_edges.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace versavis::firmware;

TEST_CASE("ready_edges: the newest edge before a reading is found, as long as it is kept") {
    ReadyEdges edges;
    edges.configure(1'000'000);
    Nanoseconds stamp = 0;
    std::uint32_t number = 0;
    CHECK_FALSE(edges.find(5'000'000, stamp, number));
    for (int i = 1; i <= 20; ++i) REQUIRE(edges.add(i * 1'000'000));
    CHECK(edges.count() == 20);
    CHECK(edges.newest() == 20'000'000);
    REQUIRE(edges.find(20'000'000, stamp, number));
    CHECK(stamp == 20'000'000);
    CHECK(number == 20);
    REQUIRE(edges.find(19'999'999, stamp, number));
    CHECK(stamp == 19'000'000);
    CHECK(number == 19);
    REQUIRE(edges.find(5'000'000, stamp, number));
    CHECK(number == 5);
    CHECK_FALSE(edges.find(4'999'999, stamp, number));
}

TEST_CASE("ready_edges: echoes are left out, by the part's period and at most 100 us") {
    ReadyEdges edges;
    edges.configure(400'000);
    CHECK(edges.add(1'000'000));
    CHECK_FALSE(edges.add(1'000'300));
    CHECK_FALSE(edges.add(1'049'999));
    CHECK(edges.add(1'050'000));
    CHECK(edges.count() == 2);
    CHECK(edges.take_echoes() == 2);
    CHECK(edges.take_echoes() == 0);
    edges.configure(10'000'000);
    CHECK(edges.count() == 0);
    CHECK(edges.add(1));
    CHECK_FALSE(edges.add(100'000));
    CHECK(edges.add(100'001));
}

TEST_CASE("ready_edges: how far echoes reach, for any period") {
    for (const Nanoseconds period : {8, 720'000, 799'992, 800'000, 880'000, 100'000'000}) {
        const Nanoseconds width = std::min<Nanoseconds>(period / 8, 100'000);
        ReadyEdges edges;
        edges.configure(period);
        REQUIRE(edges.add(1'000'000));
        CHECK_FALSE(edges.add(1'000'000 + width - 1));
        CHECK(edges.add(1'000'000 + width));
    }
}

TEST_CASE("ready_edges: edges from before lost ones are not found, and count all the same") {
    ReadyEdges edges;
    edges.configure(1'000'000);
    for (int i = 1; i <= 5; ++i) REQUIRE(edges.add(i * 1'000'000));
    edges.forget();
    Nanoseconds stamp = 0;
    std::uint32_t number = 0;
    CHECK_FALSE(edges.find(6'000'000, stamp, number));
    CHECK_FALSE(edges.add(5'000'300));  // still an echo
    REQUIRE(edges.add(9'000'000));
    CHECK_FALSE(edges.find(8'999'999, stamp, number));
    REQUIRE(edges.find(9'000'000, stamp, number));
    CHECK(number == 6);
}

TEST_CASE("ready_edges: until when edges are echoes of the newest one") {
    ReadyEdges edges;
    edges.configure(400'000);
    CHECK(edges.quiet_until() == 0);
    CHECK(edges.add(1'000'000));
    CHECK(edges.quiet_until() == 1'049'999);
    CHECK_FALSE(edges.add(edges.quiet_until()));
    CHECK(edges.add(edges.quiet_until() + 1));
}
