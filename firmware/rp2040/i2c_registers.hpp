// SPDX-License-Identifier: BSD-3-Clause
// The registers of the I2C controller that this port uses.
#pragma once

#include "registers.hpp"

namespace versavis::rp2040 {

struct I2c {
    Register control, target, own;
    Register reserved0;
    Register data;
    Register slow_high, slow_low, fast_high, fast_low;
    Register reserved1[2];
    Register interrupts, interrupt_mask, raw_interrupts, receive_threshold, transmit_threshold;
    Register clear_all, clear_under, clear_over, clear_transmit_over, clear_request, clear_abort,
        clear_done, clear_activity, clear_stop, clear_start, clear_general;
    Register enable, status, transmit_level, receive_level, hold, abort_source;
};
inline I2c& i2c1() { return block_at<I2c>(0x40048000); }
static_assert(offsetof(I2c, data) == 0x10 && offsetof(I2c, fast_high) == 0x1C &&
              offsetof(I2c, interrupts) == 0x2C && offsetof(I2c, clear_abort) == 0x54 &&
              offsetof(I2c, enable) == 0x6C && offsetof(I2c, abort_source) == 0x80);

}  // namespace versavis::rp2040
