// SPDX-License-Identifier: BSD-3-Clause
// A flag set by interrupts: the main loop is to poll the core.
#pragma once

#include "registers.hpp"

namespace versavis::rp2040 {

class WakeFlag {
 public:
    void ask() {
        asked_ = true;
        wake();
    }
    /// The main loop runs when no interrupt does; without it, it sleeps on.
    static void wake() { system_control() = 0; }
    static void sleep_after_interrupts() { system_control() = sleep_on_exit; }
    /// Later events set it again.
    void forget() { asked_ = false; }
    bool asked() const { return asked_; }

 private:
    volatile bool asked_ = true;
};

}  // namespace versavis::rp2040
