// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis flash`: puts new firmware into the board and sees it run.
#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "board/board_search.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

struct FlashSettings {
    std::string file;
    BoardChoice board;
    std::string instance;  ///< of the service, which may have the board
    std::function<bool()> stop = [] { return false; };
    /// What is being done, and how much of it is.
    std::function<void(const std::string& what, std::size_t done, std::size_t all)> progress =
        [](const std::string&, std::size_t, std::size_t) {};
};

struct Flashed {
    std::string port;
    std::string serial;
    std::string before;  ///< firmware; empty: it was in its boot loader
    std::string after;
    std::size_t bytes = 0;
    Duration took;
};

/// The first sector is erased first and written last: a board that was left half written stays in
/// its boot loader, whenever it lost power, and is flashed again.
Expected<Flashed> flash(const FlashSettings& settings);

/// Flash every connected board, one after the other, whatever becomes of each; `finished` is called
/// for each. How many there are. Error: none was begun.
Expected<std::size_t> flash_all(
    const FlashSettings& settings,
    const std::function<void(const FoundBoard&, const Expected<Flashed>&)>& finished);

std::string to_text(const Flashed& flashed);
nlohmann::json to_json(const Flashed& flashed);

}  // namespace versavis::client
