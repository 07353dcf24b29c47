// SPDX-License-Identifier: BSD-3-Clause
// Many worlds, and what became of their frames in all: the fault matrix, and faults at random.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "world.hpp"

namespace versavis::test {

/// The sum over some worlds.
struct Totals {
    std::uint64_t runs = 0;
    std::uint64_t faults = 0;
    std::uint64_t frames = 0;
    std::uint64_t published = 0;
    std::uint64_t wrong = 0;
    std::uint64_t withheld = 0;
    std::uint64_t withheld_needlessly = 0;
    std::uint64_t slips = 0;
    std::uint64_t not_locked =
        0;  ///< worlds that ended without proof, although the last fault was long past
    std::vector<Duration> first_published;  ///< of starts at 20 Hz without a late frame
    std::vector<Duration> recoveries;       ///< at 20 Hz
    std::vector<std::uint64_t> wrong_seeds;

    void add(const WorldSettings& settings, const Verdict& verdict);
};

/// One row of the matrix: a fault with a kind of camera clock, over both widths of ids and all
/// rates.
struct Row {
    FaultKind kind{};
    WorldClock clock{};
    Totals totals;
};

/// Each kind of fault x width of ids x camera clock x rate, with `seeds` variations of the rest.
std::vector<Row> run_matrix(unsigned seeds);

/// How the cameras of random worlds answer triggers.
enum class Answers {
    each,     ///< one frame for each, but for faults
    unevenly  ///< they also ignore every n-th or random ones, or send frames twice, and all
              ///< records may be late
};

/// Faults of all kinds at random, close together at times. `progress` is called after each world.
Totals run_random(std::uint64_t faults, std::uint64_t seed, WorldClock clock,
                  const std::function<void(const Totals&)>& progress = {},
                  Answers answers = Answers::each);

/// The value that `share` of them do not exceed; zero without any.
Duration quantile(std::vector<Duration> values, double share);

std::string to_table(const std::vector<Row>& rows);
std::string to_text(const std::string& name, const Totals& totals);

}  // namespace versavis::test
