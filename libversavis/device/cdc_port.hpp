// SPDX-License-Identifier: BSD-3-Clause
// The CDC-ACM function of the board: a serial port, without the kernel's tty in between.
#pragma once

#include <cstdint>
#include <span>

#include "device/usb_bus.hpp"

namespace versavis::device {

/// For a request or a write: a board that takes none for so long is gone.
inline constexpr Duration transfer_timeout = milliseconds(500);

/// Found by the descriptors of the device, and claimed for this program.
class CdcPort {
 public:
    /// Says that a program is there (DTR, RTS). Error: also when another one has it.
    static UsbExpected<CdcPort> open(UsbHandle handle);

    /// Error UsbFault::late: nothing came in time.
    UsbExpected<std::size_t> read(std::span<std::uint8_t> into, Duration timeout) {
        return handle_.read(data_.endpoint_in, into, timeout);
    }
    UsbExpected<> write(std::span<const std::uint8_t> bytes) {
        return handle_.write(data_.endpoint_out, bytes, transfer_timeout);
    }

    /// Reboots the board into its boot loader in the way of serial ports, by 1200 baud, also when
    /// its program hangs.
    void touch();

    const UsbHandle& handle() const { return handle_; }
    const UsbFunction& data() const { return data_; }

 private:
    CdcPort(UsbHandle handle, int control, const UsbFunction& data)
        : handle_(std::move(handle)), control_(control), data_(data) {}

    void request(std::uint8_t request, std::uint16_t value, std::span<std::uint8_t> data);

    UsbHandle handle_;
    int control_;
    UsbFunction data_;
};

}  // namespace versavis::device
