// SPDX-License-Identifier: BSD-3-Clause
// `versavis board selftest --bringup`: leads through the first power-up of a board, step by step.
// The board sends what each step names, and the user looks at it with a scope.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "board/self_test.hpp"

namespace versavis::client {

/// docs/user/board.md has a row for each.
struct BringUpStep {
    const char* name;
    const char* connect;  ///< beforehand
    const char* where;    ///< to measure, pins of a Pico
    const char* expect;   ///< there
};

std::span<const BringUpStep> bring_up_steps();

struct BringUpResult {
    const BringUpStep* step = nullptr;
    std::optional<bool> as_expected;  ///< what the user saw; none: nobody looked
    bool failed = false;              ///< by what the board itself reports
    std::string finding;              ///< what it reports
};

struct BringUp {
    std::string serial;
    std::string firmware;
    std::vector<BringUpResult> results;

    /// Nothing failed, and nothing that somebody looked at was other than expected.
    bool passed() const;
};

struct BringUpSettings {
    BoardChoice board;
    std::string instance;
    /// Before a step: its wires are to be joined.
    std::function<void(const BringUpStep&)> prepare = [](const BringUpStep&) {};
    /// While it is shown; returns what the user saw.
    std::function<std::optional<bool>(const BringUpStep&)> look = [](const BringUpStep&) {
        return std::optional<bool>();
    };
    std::function<bool()> stop = [] { return false; };
};

/// Leaves the outputs at rest. Errors: no board, another program has it, stopped.
Expected<BringUp> bring_up(const BringUpSettings& settings);

std::string to_text(const BringUp& done, bool json);

}  // namespace versavis::client
