// SPDX-License-Identifier: BSD-3-Clause
// What every scenario's stamps must say of themselves.
#pragma once

#include <catch2/catch.hpp>

#include "score.hpp"

namespace versavis::clock_world {

/// Sigma is neither too small nor too large, and errors stay within the bound.
inline void check_honest(const Score& score) {
    CHECK(score.nees() > 0.5);
    CHECK(score.nees() < 2);
    CHECK(score.beyond_bound() < 0.001);
}

}  // namespace versavis::clock_world
