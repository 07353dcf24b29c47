// SPDX-License-Identifier: BSD-3-Clause
// What runs before main(): the table of vectors, and variables that are to be zero.
#include "start.hpp"

#include "registers.hpp"

extern "C" {

extern std::uint32_t bss_begin[];
extern std::uint32_t bss_end[];
extern std::uint32_t stack_top[];
using Function = void (*)();
extern const Function constructors_begin[];
extern const Function constructors_end[];

[[gnu::used, noreturn]] static void start() {
    for (std::uint32_t* word = bss_begin; word != bss_end; ++word) *word = 0;
    for (const Function* call = constructors_begin; call != constructors_end; ++call) (*call)();
    firmware_main();
}

/// An interrupt that nobody asked for, a fault, or a call of what an abstract class leaves open.
[[gnu::used, noreturn]] static void lost() { versavis::rp2040::restart_at_once(); }
[[noreturn, gnu::used]] void pure_virtual() __asm__("__cxa_pure_virtual");
void pure_virtual() { lost(); }

struct Vectors {
    std::uint32_t* stack;
    Function exceptions[15];
    Function interrupts[versavis::rp2040::interrupt_count];
};

[[gnu::section(".vectors"), gnu::used]] extern const Vectors vectors = {
    stack_top,
    {start, lost, lost, lost, lost, lost, lost, lost, lost, lost, lost, lost, lost, lost, lost},
    {on_commit_time, on_bus_time,   on_wake_time,   on_usb_watch, lost, on_usb,
     lost,           on_change,     on_commit_time, lost,         lost, on_ring_end,
     on_bus_dma,     on_data_ready, lost,           lost,         lost, lost,
     lost,           lost,          on_uart,        lost,         lost, lost,
     on_i2c,         lost,          on_usb_work,    lost,         lost, lost,
     lost,           lost},
};
}

namespace versavis::rp2040 {

void restart_at_once() {
    watchdog_timer().control = watchdog_trigger;
    for (;;) {
    }
}

}  // namespace versavis::rp2040
