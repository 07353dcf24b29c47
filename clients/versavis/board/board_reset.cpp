// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_reset.hpp"

#include <fmt/format.h>

#include "board/picoboot.hpp"

namespace versavis::client {

namespace {

/// The nonce of the life that ends, or none out of the boot loader.
Expected<std::optional<std::uint32_t>> end_life(const FoundBoard& board,
                                                const std::string& instance) {
    if (board.in_boot_loader) {
        auto boot_loader = Picoboot::open(board.device);
        if (!boot_loader) return Unexpected(boot_loader.error());
        if (auto done = boot_loader->reboot(); !done) return Unexpected(done.error());
        return std::optional<std::uint32_t>();
    }
    auto conversation = open_board(board, instance);
    if (!conversation) return Unexpected(conversation.error());
    const auto greeting = conversation->greet();
    if (!greeting) return Unexpected(greeting.error());
    if (auto sent = conversation->send(wire::Reboot{wire::reboot_magic, 0}); !sent)
        return Unexpected(sent.error());
    return std::optional(greeting->nonce);
}

}  // namespace

Expected<BoardIdentity> reset_board(const ResetSettings& settings) {
    const auto bus = device::UsbBus::open();
    if (!bus) return Unexpected(bus.error());
    const auto found = find_board(*bus, settings.board);
    if (!found) return Unexpected(found.error());
    const auto ended = end_life(*found, settings.instance);
    if (!ended) return Unexpected(ended.error());
    return wait_for_hello(*bus, found->device.port(), settings.instance, *ended, settings.stop);
}

std::string to_text(const BoardIdentity& board, bool json) {
    if (json)
        return nlohmann::json{{"port", board.port},
                              {"serial", board.serial},
                              {"firmware", board.firmware},
                              {"nonce", board.nonce}}
                   .dump() +
               "\n";
    return fmt::format("board {} at {} was reset and runs {}\n", board.serial, board.port,
                       board.firmware);
}

}  // namespace versavis::client
