// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis board info`: who the board is, what it has, and how it is.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "board/board_search.hpp"

namespace versavis::client {

/// Keys are those of `board` in the status document, as far as they are known, and `source`:
/// "service" when that has the board and was asked, or "usb".
Expected<nlohmann::json> board_info(const BoardChoice& choice, const std::string& instance);

std::string board_text(const nlohmann::json& info);

}  // namespace versavis::client
