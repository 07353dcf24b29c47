// SPDX-License-Identifier: BSD-3-Clause
#include "clocks.hpp"

#include "registers.hpp"

namespace versavis::rp2040 {

namespace {

constexpr std::uint32_t crystal_mhz = 12;

void start_crystal() {
    constexpr std::uint32_t range_to_15_mhz = 0xAA0;
    constexpr std::uint32_t enable = 0xFAB000;
    constexpr std::uint32_t stable = 1U << 31U;
    // In steps of 256 cycles: 1 ms. If lower, a slow crystal may be read as steady too early.
    crystal().startup = crystal_mhz * 1000 / 256;
    crystal().control = enable | range_to_15_mhz;
    while ((crystal().status & stable) == 0) {
    }
}

void start_pll(Pll& pll, std::uint32_t multiplier, std::uint32_t first, std::uint32_t second) {
    constexpr std::uint32_t locked = 1U << 31U;
    constexpr std::uint32_t power_down = 1U << 0U;
    constexpr std::uint32_t post_dividers_down = 1U << 3U;
    constexpr std::uint32_t oscillator_down = 1U << 5U;
    pll.control = 1;
    pll.feedback = multiplier;
    clear_bits(pll.power, power_down | oscillator_down);
    while ((pll.control & locked) == 0) {
    }
    pll.post_dividers = first << 16U | second << 12U;
    clear_bits(pll.power, post_dividers_down);
}

/// Of a divider, whose lower 8 bits are a fraction. A reset by another program's watchdog may leave
/// others.
constexpr std::uint32_t undivided = 1U << 8U;

/// One bit of `selected` is set for each source that such a clock can switch to without a glitch.
void select(ClockGenerator& clock, std::uint32_t source, std::uint32_t auxiliary) {
    clock.divider = undivided;
    clock.control = auxiliary << 5U | source;
    while (clock.selected != 1U << source) {
    }
}

/// From its first source, which is the right one for both that have none without a glitch.
void start(ClockGenerator& clock) {
    constexpr std::uint32_t enable = 1U << 11U;
    clock.divider = undivided;
    clock.control = enable;
}

}  // namespace

void start_clocks() {
    constexpr std::uint32_t from_crystal = 2;
    constexpr std::uint32_t from_reference = 0;
    constexpr std::uint32_t from_auxiliary = 1;
    clocks().resuscitate = 0;
    start_crystal();
    // After a reset by the watchdog the PLLs may be in use.
    select(clocks().system, from_reference, 0);
    select(clocks().reference, from_crystal, 0);
    restart_blocks(reset_pll_sys | reset_pll_usb);
    start_pll(pll_sys(), 125, 6, 2);  // 12 * 125 / 12 = 125 MHz
    start_pll(pll_usb(), 100, 5, 5);  // 12 * 100 / 25 = 48 MHz
    select(clocks().system, from_auxiliary, 0);
    start(clocks().peripherals);
    start(clocks().usb);
    constexpr std::uint32_t tick_enable = 1U << 9U;
    watchdog_timer().tick = tick_enable | crystal_mhz;
    restart_blocks(reset_timer);
}

}  // namespace versavis::rp2040
