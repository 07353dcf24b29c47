// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_search.hpp"

#include <fmt/format.h>
#include <time.h>

#include "wire/usb_identity.hpp"

namespace versavis::client {

namespace {

/// Between two looks at the bus.
constexpr Duration look_interval = milliseconds(50);

bool fits(const FoundBoard& board, const BoardChoice& choice) {
    return (choice.port.empty() || choice.port == board.device.port()) &&
           (choice.serial.empty() || choice.serial == board.serial);
}

Unexpected<> none_fits(const std::vector<FoundBoard>& all, const BoardChoice& choice) {
    for (const FoundBoard& board : all)
        if (board.is_pico_2 && fits(board, choice))
            return failure("board at " + board.device.port(),
                           "is a Pico 2: its chip, an RP2350, is not the one that the firmware is "
                           "made for",
                           "use a board with an RP2040: a Pico, Pico H, Pico W or Pico WH");
    std::string others;
    for (const FoundBoard& board : all) others += (others.empty() ? "" : ", ") + board.text();
    const std::string wanted = choice.serial.empty() ? choice.port : "serial " + choice.serial;
    return failure("USB", fmt::format("no board with {}, but {}", wanted, others),
                   "correct --serial or --port; a boot loader does not know its serial number, and "
                   "is chosen with --port");
}

}  // namespace

std::string FoundBoard::text() const {
    const std::string name = serial.empty() ? "serial unknown" : "serial " + serial;
    return fmt::format("{} ({})", device.port(),
                       is_pico_2        ? "Pico 2"
                       : in_boot_loader ? "boot loader"
                                        : name);
}

Expected<std::vector<FoundBoard>> list_boards(const device::UsbBus& bus) {
    std::vector<FoundBoard> boards;
    for (const device::UsbDevice& device : bus.find(wire::usb_vendor, wire::usb_product)) {
        const auto handle = device.open();
        boards.push_back({device, false, false, handle ? handle->serial().value_or("") : ""});
        if (!handle)
            boards.back().problem = handle.error().as_error("", "cannot be opened").message();
    }
    for (const device::UsbDevice& device :
         bus.find(wire::boot_loader_vendor, wire::boot_loader_rp2040))
        boards.push_back({device, true, false, ""});
    for (const device::UsbDevice& device :
         bus.find(wire::boot_loader_vendor, wire::boot_loader_rp2350))
        boards.push_back({device, true, true, ""});
    if (!boards.empty()) return boards;
    return failure("USB",
                   fmt::format("no board ({:04x}:{:04x}), and no boot loader ({:04x}:{:04x})",
                               wire::usb_vendor, wire::usb_product, wire::boot_loader_vendor,
                               wire::boot_loader_rp2040),
                   "plug it in, or hold its BOOTSEL button while you do; 'lsusb' lists connected "
                   "devices");
}

Expected<FoundBoard> find_board(const device::UsbBus& bus, const BoardChoice& choice) {
    const auto all = list_boards(bus);
    if (!all) return Unexpected(all.error());
    std::vector<FoundBoard> fitting;
    std::string names;
    for (const FoundBoard& board : *all) {
        if (board.is_pico_2 || !fits(board, choice)) continue;
        fitting.push_back(board);
        names += (names.empty() ? "" : ", ") + board.text();
    }
    if (fitting.empty()) return none_fits(*all, choice);
    if (fitting.size() > 1)
        return failure("USB", fmt::format("{} boards: {}", fitting.size(), names),
                       "choose one with --serial or --port");
    return fitting.front();
}

std::optional<device::UsbDevice> wait_for_board(const device::UsbBus& bus, const std::string& port,
                                                bool in_boot_loader, Duration timeout,
                                                const std::function<bool()>& stop) {
    const std::uint16_t vendor = in_boot_loader ? wire::boot_loader_vendor : wire::usb_vendor;
    const std::uint16_t product = in_boot_loader ? wire::boot_loader_rp2040 : wire::usb_product;
    const HostTime deadline = host_now() + timeout;
    while (!stop() && host_now() < deadline) {
        for (const device::UsbDevice& device : bus.find(vendor, product))
            if (device.port() == port) return device;
        const timespec pause{0, look_interval.ns};
        nanosleep(&pause, nullptr);
    }
    return std::nullopt;
}

}  // namespace versavis::client
