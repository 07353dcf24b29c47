// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/belief.hpp"

#include <catch2/catch.hpp>

using namespace versavis::clock;

namespace {

Belief some_belief() {
    Belief belief = Belief::after_exchange(1e6);
    belief.mean << 5, 20e3, 3, 250e3;
    belief.covariance(0, 1) = belief.covariance(1, 0) = 1e8;
    belief.covariance(1, 2) = belief.covariance(2, 1) = 1e3;
    return belief;
}

}  // namespace

TEST_CASE("belief: two short steps are one long one, but for a drift that fades") {
    const Belief belief = some_belief();
    const Belief once = belief.after(versavis::seconds(2));
    const Belief twice = belief.after(versavis::seconds(1)).after(versavis::seconds(1));
    CHECK(once.mean.isApprox(twice.mean, 1e-4));
    CHECK(once.covariance.isApprox(twice.covariance, 1e-2));
}

TEST_CASE("belief: the offset later, and its variance, are those of the belief that has aged") {
    const Belief belief = some_belief();
    for (const std::int64_t ms : {0, 500, 10'000, 60'000}) {
        const versavis::Duration span = versavis::milliseconds(ms);
        const Belief aged = belief.after(span);
        CHECK(belief.offset_after(span) == Approx(aged.mean[0]));
        CHECK(belief.offset_variance_after(span) == Approx(aged.covariance(0, 0)));
    }
    CHECK(belief.offset_variance_after(versavis::seconds(60)) >
          belief.offset_variance_after(versavis::seconds(10)));
}
