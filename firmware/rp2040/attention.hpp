// SPDX-License-Identifier: BSD-3-Clause
// What interrupts leave for the main loop: the core is to be polled.
#pragma once

#include "registers.hpp"

namespace versavis::rp2040 {

class Attention {
 public:
    void ask() {
        asked_ = true;
        wake();
    }
    /// The main loop runs when no interrupt does; without it, it sleeps on.
    static void wake() { system_control() = 0; }
    static void sleep_after_interrupts() { system_control() = sleep_on_exit; }
    /// What happens from here on asks anew.
    void forget() { asked_ = false; }
    bool asked() const { return asked_; }

 private:
    volatile bool asked_ = true;
};

}  // namespace versavis::rp2040
