// SPDX-License-Identifier: BSD-3-Clause
#include "reboot_port.hpp"

#include "registers.hpp"
#include "start.hpp"

namespace versavis::rp2040 {

namespace {

/// It counts twice each microsecond (erratum RP2040-E1).
constexpr std::uint32_t watchdog_limit = 2 * 1'000'000;

/// In a register that survives all but a loss of power: how the firmware last ended. A restart by
/// the watchdog with neither is the boot loader's, which restarts the chip by that, too.
constexpr std::uint32_t asked_for = 0x56495341;
constexpr std::uint32_t still_running = 0x56495342;

/// Everything but the oscillators.
constexpr std::uint32_t all_blocks = 0x1FFFC;

/// A table of the ROM, by the two letters of an entry's name.
template <class Function>
Function rom_function(char first, char second) {
    using Find = void* (*)(const std::uint16_t*, std::uint32_t);
    const auto half_word = [](std::uintptr_t at) {
        // The ROM begins at 0, which the compiler treats as no address.
        __asm__("" : "+r"(at));
        return *reinterpret_cast<const volatile std::uint16_t*>(at);
    };
    const auto find = reinterpret_cast<Find>(std::uintptr_t{half_word(0x18)});
    const auto* table = reinterpret_cast<const std::uint16_t*>(std::uintptr_t{half_word(0x14)});
    const auto name = static_cast<std::uint32_t>(first) | static_cast<std::uint32_t>(second) << 8U;
    return reinterpret_cast<Function>(find(table, name));
}

}  // namespace

void enter_boot_loader() {
    watchdog_timer().scratch[0] = 0;
    using Enter = void (*)(std::uint32_t activity_pins, std::uint32_t disabled_interfaces);
    rom_function<Enter>('U', 'B')(0, 0);
    for (;;) {
    }
}

wire::ResetCause reset_cause() {
    constexpr std::uint32_t had_run_pin = 1U << 16U;
    const std::uint32_t end = watchdog_timer().scratch[0];
    watchdog_timer().scratch[0] = still_running;
    if (watchdog_timer().reason != 0) {
        if (end == asked_for) return wire::ResetCause::software;
        return end == still_running ? wire::ResetCause::watchdog : wire::ResetCause::update;
    }
    if ((regulator().chip_reset & had_run_pin) != 0) return wire::ResetCause::pin;
    return wire::ResetCause::power_on;  // or a brown-out, which has the same bit
}

void RebootPort::reboot(bool to_boot_loader) {
    if (to_boot_loader) enter_boot_loader();
    watchdog_timer().scratch[0] = asked_for;
    restart_at_once();
}

void WatchdogPort::begin() {
    power_on_states().watchdog_select = all_blocks;
    feed();
    set_bits(watchdog_timer().control, watchdog_enable);
}

void WatchdogPort::feed() { watchdog_timer().load = watchdog_limit; }

}  // namespace versavis::rp2040
