// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/belief_matrix.hpp"

#include <catch2/catch.hpp>

using namespace versavis::clock;

namespace {

Belief some_belief() {
    Belief belief = Belief::after_exchange(1e6);
    vector(belief) << 5, 20e3, 3, 250e3;
    matrix(belief)(0, 1) = matrix(belief)(1, 0) = 1e8;
    matrix(belief)(1, 2) = matrix(belief)(2, 1) = 1e3;
    return belief;
}

}  // namespace

TEST_CASE("belief: two short steps are one long one, but for a drift that fades") {
    const Belief belief = some_belief();
    const Belief once = belief.after(versavis::seconds(2));
    const Belief twice = belief.after(versavis::seconds(1)).after(versavis::seconds(1));
    CHECK(vector(once).isApprox(vector(twice), 1e-4));
    CHECK(matrix(once).isApprox(matrix(twice), 1e-2));
}

TEST_CASE("belief: the offset later, and its variance, are those of the belief that has aged") {
    const Belief belief = some_belief();
    for (const std::int64_t ms : {0, 500, 10'000, 60'000}) {
        const versavis::Duration span = versavis::milliseconds(ms);
        const Belief aged = belief.after(span);
        CHECK(belief.offset_after(span) == Approx(aged.mean[0]));
        CHECK(belief.offset_variance_after(span) == Approx(matrix(aged)(0, 0)));
    }
    CHECK(belief.offset_variance_after(versavis::seconds(60)) >
          belief.offset_variance_after(versavis::seconds(10)));
}
