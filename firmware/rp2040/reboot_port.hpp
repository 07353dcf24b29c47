// SPDX-License-Identifier: BSD-3-Clause
// Restarts of the chip: on request, by the watchdog, into the boot loader; and why it last did.
#pragma once

#include "base/hal.hpp"
#include "wire/messages.hpp"

namespace versavis::rp2040 {

/// The ROM's boot loader for USB. All pins are inputs there.
[[noreturn]] void enter_boot_loader();

wire::ResetCause reset_cause();

class RebootPort final : public firmware::Rebooter {
 public:
    void reboot(bool to_boot_loader) override;
};

class WatchdogPort final : public firmware::Watchdog {
 public:
    void begin();
    void feed() override;
};

}  // namespace versavis::rp2040
