// SPDX-License-Identifier: BSD-3-Clause
// The RP2040's own boot loader: erases, writes and reads its flash by PICOBOOT, the vendor's USB
// interface (RP2040 datasheet, "USB PICOBOOT interface").
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "device/usb_bus.hpp"

namespace versavis::client {

/// Each call waits for its end. After an error the boot loader takes commands again, if it is still
/// there.
class Picoboot {
 public:
    /// Claims the interface, and the flash for this program alone: the drive that the boot loader
    /// also is goes away.
    static Expected<Picoboot> open(const device::UsbDevice& device);

    /// Whole sectors.
    Expected<> erase(std::uint32_t address, std::uint32_t size);
    /// Whole pages, which are erased.
    Expected<> write(std::uint32_t address, std::span<const std::uint8_t> bytes);
    Expected<> read(std::uint32_t address, std::span<std::uint8_t> into);
    /// Starts what is in the flash.
    Expected<> reboot();

 private:
    struct Command;

    Picoboot(device::UsbHandle handle, device::UsbFunction function, std::string where)
        : handle_(std::move(handle)), function_(function), where_(std::move(where)) {}

    Expected<> take_over();
    device::UsbExpected<> reset();
    Expected<> run(const Command& command, std::span<std::uint8_t> in,
                   std::span<const std::uint8_t> out);
    device::UsbExpected<> exchange(const Command& command, std::span<std::uint8_t> in,
                                   std::span<const std::uint8_t> out);
    Error explain(const Command& command, const device::UsbError& error);
    std::string reason(const Command& command);

    device::UsbHandle handle_;
    device::UsbFunction function_;
    std::string where_;
    std::uint32_t token_ = 0;
};

}  // namespace versavis::client
