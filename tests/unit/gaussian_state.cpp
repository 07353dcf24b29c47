// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/gaussian_state_matrix.hpp"

#include <catch2/catch.hpp>

using namespace versavis::clock;

namespace {

GaussianState some_state() {
    GaussianState state = GaussianState::after_exchange(1e6);
    vector(state) << 5, 20e3, 3, 250e3;
    matrix(state)(0, 1) = matrix(state)(1, 0) = 1e8;
    matrix(state)(1, 2) = matrix(state)(2, 1) = 1e3;
    return state;
}

}  // namespace

TEST_CASE("gaussian_state: two short steps are one long one, but for a drift that fades") {
    const GaussianState state = some_state();
    const GaussianState once = state.after(versavis::seconds(2));
    const GaussianState twice = state.after(versavis::seconds(1)).after(versavis::seconds(1));
    CHECK(vector(once).isApprox(vector(twice), 1e-4));
    CHECK(matrix(once).isApprox(matrix(twice), 1e-2));
}

TEST_CASE(
    "gaussian_state: the offset later, and its variance, are those of the state that has aged") {
    const GaussianState state = some_state();
    for (const std::int64_t ms : {0, 500, 10'000, 60'000}) {
        const versavis::Duration span = versavis::milliseconds(ms);
        const GaussianState aged = state.after(span);
        CHECK(state.offset_after(span) == Approx(aged.mean[0]));
        CHECK(state.offset_variance_after(span) == Approx(matrix(aged)(0, 0)));
    }
    CHECK(state.offset_variance_after(versavis::seconds(60)) >
          state.offset_variance_after(versavis::seconds(10)));
}
