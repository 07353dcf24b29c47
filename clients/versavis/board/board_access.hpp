// SPDX-License-Identifier: BSD-3-Clause
// Opens a running board for the tool; says who has it when that cannot be.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "board/board_search.hpp"
#include "board/conversation.hpp"

namespace versavis::client {

/// The board's part of the status of the service `instance`, if that has this board. An empty port
/// is any.
std::optional<nlohmann::json> board_of_service(const std::string& instance,
                                               const std::string& port);

Expected<Conversation> open_board(const FoundBoard& board, const std::string& instance);

/// Who a board is.
struct BoardIdentity {
    std::string port;
    std::string serial;
    std::string firmware;
    std::uint32_t nonce = 0;
};

/// Waits until the board at this port runs and says who it is, to this program or, if that has it,
/// to the service. `stale` is the nonce of a life that does not count.
Expected<BoardIdentity> wait_for_hello(const device::UsbBus& bus, const std::string& port,
                                       const std::string& instance,
                                       std::optional<std::uint32_t> stale,
                                       const std::function<bool()>& stop);

}  // namespace versavis::client
