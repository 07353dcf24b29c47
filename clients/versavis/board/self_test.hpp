// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis board selftest`: sends pulses at each output and looks for them at the
// inputs that wires join them to.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "board/board_search.hpp"
#include "board/loop_check.hpp"
#include "board/test_board.hpp"

namespace versavis::client {

struct SelfTestSettings {
    BoardChoice board;
    std::string instance;
    /// Output and input of wires that must be there, "test=aux0"; empty: whatever is found.
    std::vector<std::string> wires;
    std::function<bool()> stop = [] { return false; };
    std::function<void(const char* what, std::size_t done, std::size_t all)> progress =
        [](const char*, std::size_t, std::size_t) {};
};

/// Of an output, and of an input if one heard it.
struct TestedLine {
    std::string output;
    std::string input;
    LoopFinding finding;
};

struct SelfTest {
    std::string serial;
    std::string firmware;
    std::vector<TestedLine> lines;

    /// Each wire that was asked for is there, at least one is, and none failed.
    bool passed = false;
};

Expected<SelfTest> self_test(const SelfTestSettings& settings);
Expected<SelfTest> self_test(const SelfTestSettings& settings, TestBoard& board);

/// A line for each output.
std::string lines_text(const SelfTest& test);

std::string to_text(const SelfTest& test, bool json);

}  // namespace versavis::client
