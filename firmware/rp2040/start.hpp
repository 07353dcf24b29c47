// SPDX-License-Identifier: BSD-3-Clause
// The functions that the table of vectors names.
#pragma once

extern "C" {
[[noreturn]] void firmware_main();
void on_commit_time();
void on_bus_time();
void on_wake_time();
void on_usb_watch();
void on_usb();
void on_usb_work();
void on_change();
void on_ring_end();
void on_bus_dma();
void on_data_ready();
void on_uart();
void on_i2c();
}

namespace versavis::rp2040 {

/// As after power-up, except for the reported reason.
[[noreturn]] void restart_at_once();

}  // namespace versavis::rp2040
