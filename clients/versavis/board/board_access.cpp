// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_access.hpp"

#include <fmt/format.h>
#include <time.h>

#include "status/status_document.hpp"

namespace versavis::client {

namespace {

/// Until a board that was rebooted has said hello: it boots within a second, and hosts take another
/// to list it.
constexpr Duration boot_patience = seconds(10);

/// Between two tries.
constexpr Duration try_interval = milliseconds(100);

Error busy(const FoundBoard& board, const std::string& instance, const device::UsbError& error) {
    const std::string where = "board at " + board.device.port();
    if (error.fault != device::UsbFault::busy) return error.as_error(where, "cannot be opened");
    const auto status = read_status(instance);
    if (!status)
        return {where, "another program has it open",
                "close that, a service with another --instance for example"};
    return {
        where,
        fmt::format("the service '{}' (process {}) has it open", instance, status->value("pid", 0)),
        "stop it, 'sudo systemctl stop versavisd', run this again, then start it again"};
}

/// None: it is not there yet, or not ready.
std::optional<BoardIdentity> identity(const device::UsbDevice& device,
                                      const std::string& instance) {
    auto conversation = Conversation::open(device);
    if (conversation) {
        const auto greeting = conversation->greet();
        if (!greeting) return std::nullopt;
        return BoardIdentity{device.port(), greeting->serial(), greeting->firmware(),
                             greeting->nonce};
    }
    if (conversation.error().fault != device::UsbFault::busy) return std::nullopt;
    const auto board = board_of_service(instance, device.port());
    if (!board) return std::nullopt;
    return BoardIdentity{device.port(), board->value("serial", ""), board->value("firmware", ""),
                         board->value("nonce", 0U)};
}

}  // namespace

std::optional<nlohmann::json> board_of_service(const std::string& instance,
                                               const std::string& port) {
    const auto status = read_status(instance);
    if (!status || !status->contains("board")) return std::nullopt;
    const nlohmann::json& board = (*status)["board"];
    if (board.value("state", "") != "running") return std::nullopt;
    if (!port.empty() && board.value("port", "") != port) return std::nullopt;
    return board;
}

Expected<Conversation> open_board(const FoundBoard& board, const std::string& instance) {
    auto conversation = Conversation::open(board.device);
    if (!conversation) return Unexpected(busy(board, instance, conversation.error()));
    return std::move(*conversation);
}

Expected<BoardIdentity> wait_for_hello(const device::UsbBus& bus, const std::string& port,
                                       const std::string& instance,
                                       std::optional<std::uint32_t> stale,
                                       const std::function<bool()>& stop) {
    const HostTime deadline = host_now() + boot_patience;
    while (!stop() && host_now() < deadline) {
        if (const auto device = wait_for_board(bus, port, false, deadline - host_now(), stop)) {
            const auto found = identity(*device, instance);
            if (found && found->nonce != stale) return *found;
        }
        const timespec pause{0, try_interval.ns};
        nanosleep(&pause, nullptr);
    }
    return failure(
        "board at " + port,
        stop() ? "stopped waiting"
               : fmt::format("it has not said hello in {} s", boot_patience.ns / 1'000'000'000),
        "look for it with 'versavis board info'; if it is not there, hold its BOOTSEL "
        "button while you plug it in and flash it again");
}

}  // namespace versavis::client
