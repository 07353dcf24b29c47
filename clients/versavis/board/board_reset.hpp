// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis board reset`: the board starts anew, also out of its boot loader.
#pragma once

#include <functional>
#include <string>

#include "board/board_access.hpp"

namespace versavis::client {

struct ResetSettings {
    BoardChoice board;
    std::string instance;
    std::function<bool()> stop = [] { return false; };
};

/// Waits until the board says hello again.
Expected<BoardIdentity> reset_board(const ResetSettings& settings);

std::string to_text(const BoardIdentity& board, bool json);

}  // namespace versavis::client
