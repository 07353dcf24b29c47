// SPDX-License-Identifier: BSD-3-Clause
// Tables of inputs and of the complete text that each is answered with.
#pragma once

#include <catch2/catch.hpp>
#include <cstddef>
#include <string>
#include <vector>

namespace versavis::test {

struct MessageRow {
    std::string input;
    std::string message;  ///< the whole of it; all messages, one a line; empty: none
};

/// Of an input that is shown where a row differs.
inline constexpr std::size_t longest_shown = 300;

/// The message of a row whose input is valid.
inline const std::string accepted;

/// Compares the `answer` to each input with its row, and names the rows that differ.
template <class Answer>
void check_messages(const Answer& answer, const std::vector<MessageRow>& rows) {
    std::size_t row = 0;
    for (const auto& [input, message] : rows) {
        INFO("row " << row++);
        INFO(input.substr(0, longest_shown));
        CHECK(answer(input) == message);
    }
}

}  // namespace versavis::test
