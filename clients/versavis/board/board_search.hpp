// SPDX-License-Identifier: BSD-3-Clause
// Finds the one board that a command means, be it running or in its boot loader.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "device/usb_bus.hpp"

namespace versavis::client {

/// What the user says of the board; empty: there is only one.
struct BoardChoice {
    std::string serial;
    std::string port;  ///< as device::UsbDevice::port()
};

struct FoundBoard {
    device::UsbDevice device;
    bool in_boot_loader = false;
    bool is_pico_2 = false;  ///< whose chip the firmware is not for; in its boot loader
    std::string serial;  ///< empty: in its boot loader, which does not know it, or not to be opened
    std::string problem{};  ///< why it cannot be opened; empty: it can

    std::string text() const;
};

/// Error: there is none.
Expected<std::vector<FoundBoard>> list_boards(const device::UsbBus& bus);

/// Error: none fits, or more than one, or it is a Pico 2.
Expected<FoundBoard> find_board(const device::UsbBus& bus, const BoardChoice& choice);

/// The board at this port, once it is there and runs, or is in its boot loader. None: not in time,
/// or `stop` said so.
std::optional<device::UsbDevice> wait_for_board(const device::UsbBus& bus, const std::string& port,
                                                bool in_boot_loader, Duration timeout,
                                                const std::function<bool()>& stop);

}  // namespace versavis::client
