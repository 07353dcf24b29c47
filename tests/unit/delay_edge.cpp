// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/delay_edge.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

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

namespace {

/// The mean overshoot after many slots whose shortest delays `draw` gives, in ns.
template <class Draw>
double overshoot_of(const Draw& draw) {
    double sum = 0;
    constexpr unsigned seeds = 20;
    for (unsigned seed = 1; seed <= seeds; ++seed) {
        std::mt19937_64 random(seed);
        DelayEdge edge(Direction::to_host);
        edge.begin(1e5);
        for (std::int64_t slot = 0; slot < 300; ++slot)
            edge.remember({{slot}, {std::llround(draw(random))}}, [](const OffsetSample& p) {
                return static_cast<double>(p.host_minus_board.ns);
            });
        sum += edge.overshoot_ns() / seeds;
    }
    return sum;
}

}  // namespace

TEST_CASE("delay_edge: a sharp edge is not overshot, wherever it is and whatever the scale") {
    for (const double scale : {5e3, 50e3}) {
        const double overshoot = overshoot_of([&](std::mt19937_64& random) {
            return 70e3 + std::exponential_distribution<>(1 / scale)(random);
        });
        CHECK(overshoot < 0.05 * scale);
    }
}

TEST_CASE("delay_edge: delays that thin out are overshot by about what they lack to the shortest") {
    const double median = GENERATE(15e3, 40e3);
    double least = 1e9;
    const double overshoot = overshoot_of([&](std::mt19937_64& random) {
        double shortest = 1e9;
        for (int message = 0; message < 20; ++message) {
            const double polled = std::uniform_real_distribution<>(0, 125e3)(random);
            const double awake = std::lognormal_distribution<>(std::log(median), 0.5)(random);
            shortest = std::min(shortest, polled + awake);
        }
        least = std::min(least, shortest);
        return shortest;
    });
    CHECK(overshoot > 0.4 * median / 2.6);
    CHECK(overshoot < 1.5 * median / 2.6);
    CHECK(least > 0.1 * median);
}

TEST_CASE("delay_edge: the overshoot is limited, and unknown until there are enough slots") {
    CHECK(overshoot_of([](std::mt19937_64& random) {
              return std::normal_distribution<>(5e6, 500e3)(random);
          }) == Approx(20e3).epsilon(0.1));
    DelayEdge edge(Direction::to_host);
    std::mt19937_64 random(1);
    const auto remember = [&] {
        const double delay = std::normal_distribution<>(80e3, 10e3)(random);
        edge.remember({{0}, {std::llround(delay)}}, [](const OffsetSample& p) {
            return static_cast<double>(p.host_minus_board.ns);
        });
    };
    for (std::size_t slot = 1; slot < remembered_slots; ++slot) remember();
    CHECK(edge.overshoot_ns() == 0);
    remember();
    CHECK(edge.overshoot_ns() > 0);
    edge.begin(1e5);
    CHECK(edge.overshoot_ns() == 0);
}
