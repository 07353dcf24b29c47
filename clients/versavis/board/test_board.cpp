// SPDX-License-Identifier: BSD-3-Clause
#include "board/test_board.hpp"

#include <fmt/format.h>

#include "board/board_access.hpp"

namespace versavis::client {

namespace {

/// For the answer to a configuration, which waits for exposures under way.
constexpr Duration answer_patience = seconds(1);

}  // namespace

Expected<TestBoard> TestBoard::open(const BoardChoice& choice, const std::string& instance) {
    const auto bus = device::UsbBus::open();
    if (!bus) return Unexpected(bus.error());
    const auto found = find_board(*bus, choice);
    if (!found) return Unexpected(found.error());
    if (found->in_boot_loader)
        return failure("board at " + found->device.port(), "is in its boot loader",
                       "put firmware into it first: versavis flash");
    auto board = open_board(*found, instance);
    if (!board) return Unexpected(board.error());
    const auto greeting = board->greet();
    if (!greeting) return Unexpected(greeting.error());
    if (!greeting->understood)
        return failure("board at " + found->device.port(),
                       "has " + greeting->firmware() + ", which this program does not speak",
                       "flash the firmware of the same release: versavis flash");
    return TestBoard(std::move(*board), *greeting);
}

Expected<> TestBoard::configure(wire::Configuration configuration) {
    constexpr std::uint8_t all_cameras = (1U << wire::camera_count) - 1U;
    if (auto stopped = link_.send(wire::Stop{all_cameras, {}}); !stopped) return stopped;
    configuration.id = ++id_;
    if (auto sent = link_.send(configuration); !sent) return sent;
    wire::ConfigurationAnswer answer{};
    std::string refusals;
    const auto answered = [&](const wire::Packet& packet) {
        wire::Refusal refusal{};
        if (packet.read(refusal) && refusal.id == id_)
            refusals +=
                fmt::format(" (part {}, field {}, value {})", static_cast<int>(refusal.part),
                            static_cast<int>(refusal.field), refusal.value);
        return packet.read(answer) && answer.id == id_;
    };
    const auto heard = link_.listen(answered, answer_patience);
    if (!heard) return Unexpected(heard.error());
    if (!*heard)
        return failure("self-test", "the board does not answer its configuration",
                       "reset it: versavis board reset");
    if (answer.status != wire::ConfigurationStatus::taken)
        return failure("self-test", "the board refuses to send test pulses" + refusals,
                       "update its firmware: versavis flash");
    configured_ns_ = answer.origin_ns;
    return {};
}

}  // namespace versavis::client
