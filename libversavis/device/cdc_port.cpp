// SPDX-License-Identifier: BSD-3-Clause
#include "device/cdc_port.hpp"

#include <libusb.h>

#include <array>

namespace versavis::device {

namespace {

// Requests of USB's CDC class.
constexpr std::uint8_t class_interface_out = 0x21;
constexpr std::uint8_t set_line_coding = 0x20;
constexpr std::uint8_t set_control_line_state = 0x22;
constexpr std::uint16_t dtr_rts = 0x03;

/// 1200 baud, 8N1.
constexpr std::array<std::uint8_t, 7> touch_coding{0xB0, 0x04, 0, 0, 0, 0, 8};

}  // namespace

UsbExpected<CdcPort> CdcPort::open(UsbHandle handle) {
    const UsbFunction control = handle.device().function({LIBUSB_CLASS_COMM});
    const UsbFunction data = handle.device().function({LIBUSB_CLASS_DATA});
    if (control.interface < 0 || !data.complete())
        return Unexpected(UsbError{UsbFault::foreign, 0});
    for (const int interface : {control.interface, data.interface})
        if (auto claimed = handle.claim(interface); !claimed) return Unexpected(claimed.error());
    CdcPort port(std::move(handle), control.interface, data);
    port.request(set_control_line_state, dtr_rts, {});
    return port;
}

/// A board that does not take it still hears, or is gone before it has answered.
void CdcPort::request(std::uint8_t request, std::uint16_t value, std::span<std::uint8_t> data) {
    static_cast<void>(
        handle_.control(class_interface_out, request, value, control_, data, transfer_timeout));
}

void CdcPort::touch() {
    auto coding = touch_coding;
    request(set_line_coding, 0, coding);
    request(set_control_line_state, 0, {});
}

}  // namespace versavis::device
