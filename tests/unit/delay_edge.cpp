// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/delay_edge.hpp"

#include <catch2/catch.hpp>
#include <cmath>

using namespace versavis;
using namespace versavis::clock;

TEST_CASE("delay_edge: what is far above the edge says nothing, what is below it pushes") {
    const Influence far = influence_of(1e6, 1e3, 10e3);
    CHECK(std::abs(far.score) < 1e-5);
    CHECK(far.curvature < 1e-12);
    const Influence below = influence_of(-3e3, 1e3, 10e3);
    CHECK(below.score < -2e-3);
    CHECK(below.curvature > 0.5e-6);
    const Influence at = influence_of(0, 1e3, 10e3);
    CHECK(at.curvature < below.curvature);
    CHECK(at.curvature > far.curvature);
}

TEST_CASE(
    "delay_edge: influence is the slope of one smooth function, from far below to far above") {
    const double deviation = GENERATE(10.0, 1e3, 1e5);
    const double scale = GENERATE(100.0, 1e4);
    for (double excess = -50 * deviation; excess < 50 * deviation; excess += 0.37 * deviation) {
        const double step = 1e-3 * deviation;
        const Influence here = influence_of(excess, deviation, scale);
        const double slope = (influence_of(excess + step, deviation, scale).score -
                              influence_of(excess - step, deviation, scale).score) /
                             (2 * step);
        REQUIRE(std::isfinite(here.score));
        REQUIRE(here.curvature >= 0);
        REQUIRE(here.curvature <= 1 / (deviation * deviation));
        // By the level of the edge, so against the excess; where delays pull apart it counts as
        // none.
        CHECK(here.curvature ==
              Approx(std::max(slope, 0.0)).epsilon(5e-3).margin(2e-3 / (deviation * deviation)));
    }
}

TEST_CASE("delay_edge: the scale is that of the delays, however few are huge") {
    std::vector<double> uniform;
    for (int i = 0; i < 100; ++i) uniform.push_back(5000.0 + 100.0 * (i * 37 % 100));
    CHECK(*delay_scale(uniform) == Approx(10e3).epsilon(0.05));
    std::vector<double> mostly_huge = uniform;
    for (int i = 0; i < 40; ++i) uniform[static_cast<std::size_t>(i)] += 1e9;
    CHECK(*delay_scale(uniform) < 20e3);
    for (int i = 0; i < 70; ++i) mostly_huge[static_cast<std::size_t>(i)] += 1e9;
    CHECK(*delay_scale(mostly_huge) < 40e3);
    std::vector<double> few{1, 2};
    CHECK_FALSE(delay_scale(few));
}

TEST_CASE("delay_edge: the shortest of a slot is kept") {
    DelayEdge edge(Direction::to_board);
    CHECK_FALSE(edge.take());
    edge.offer({{1}, {10}}, 30);
    edge.offer({{2}, {20}}, 20);
    edge.offer({{3}, {30}}, 40);
    const auto shortest = edge.take();
    REQUIRE(shortest);
    CHECK(shortest->at == BoardTime{2});
    CHECK_FALSE(edge.take());
    CHECK(edge.sign() == -1);
}
