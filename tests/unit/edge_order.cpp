// SPDX-License-Identifier: BSD-3-Clause
#include "edge_order.hpp"

#include <catch2/catch.hpp>
#include <vector>

using namespace versavis::firmware;

namespace {

std::vector<unsigned> take_all(EdgeOrder& order, Nanoseconds settled) {
    std::vector<unsigned> inputs;
    for (Edge edge; order.take(settled, edge);) inputs.push_back(edge.input);
    return inputs;
}

}  // namespace

TEST_CASE("edge_order: edges are taken by their times, once nothing sooner can come") {
    EdgeOrder order;
    CHECK(order.add({3'000, 0, true}));
    CHECK(order.add({1'000, 1, true}));
    CHECK(order.add({2'000, 2, false}));
    CHECK(order.add({4'000, 3, true}));
    CHECK(take_all(order, 1'000).empty());
    CHECK(take_all(order, 1'001) == std::vector<unsigned>{1});
    Edge edge;
    REQUIRE(order.take(never, edge));
    CHECK(edge.at == 2'000);
    CHECK(edge.input == 2);
    CHECK_FALSE(edge.level);
    CHECK(take_all(order, never) == std::vector<unsigned>{0, 3});
    CHECK(take_all(order, never).empty());
}

TEST_CASE("edge_order: there is room for what three cameras do while a line bounces") {
    EdgeOrder order;
    for (std::uint8_t i = 0; i < 8; ++i) REQUIRE(order.add({i, i, true}));
    CHECK_FALSE(order.add({0, 8, true}));
    CHECK(take_all(order, never) == std::vector<unsigned>{0, 1, 2, 3, 4, 5, 6, 7});
    CHECK(order.add({0, 8, true}));
    order.clear();
    CHECK(take_all(order, never).empty());
}
