// SPDX-License-Identifier: BSD-3-Clause
// What the state machines do: send words at their times, stamp changes of inputs, route exposures,
// drive the light.
#pragma once

#include <array>

#include "pins.hpp"
#include "pio_assembly.hpp"

namespace versavis::rp2040 {

/// Where in the memory of its block a program begins and ends.
struct Place {
    unsigned first;
    unsigned wrap_bottom;
    unsigned wrap_top;
};

// Block 0. Its three machines start in the same cycle.

/// Each word is a time to wait, and the levels that follow.
namespace sequencer {
using namespace pio_assembly;
inline constexpr unsigned machine = 0;
inline constexpr Place place{0, 0, 2};
inline constexpr unsigned delay_bits = 32 - scheduled_outputs;
/// The waits of two words differ by as many cycles as their numbers. This is the wait of 0, and so
/// the shortest.
inline constexpr unsigned shortest_cycles = 3;
inline constexpr std::array<Code, 3> code{
    out(To::x, delay_bits),
    jump(place.first + 1, When::x_counts_down),
    out(To::pins, scheduled_outputs),
};
}  // namespace sequencer

/// Compares the inputs with what they were, every three cycles. A change goes into its FIFO, and
/// the strobe is high for two cycles.
namespace watcher {
using namespace pio_assembly;
inline constexpr unsigned machine = 1;
inline constexpr Place place{3, 7, 9};
inline constexpr unsigned flag = 0;  ///< asks for attention
inline constexpr unsigned sample_cycles = 3;
inline constexpr std::array<Code, 7> code{
    side(mov(To::isr, From::x), 1, 1),
    side(push(), 1, 1),
    side(mov(To::y, From::x), 1, 0),
    side(raise_flag(flag), 1, 0),
    side(mov(To::osr, From::pins), 1, 0),
    side(out(To::x, watched_inputs), 1, 0),
    side(jump(place.first, When::x_differs_from_y), 1, 0),
};
}  // namespace watcher

/// Counts down, once every two cycles without exception, and looks at the strobe as often. A strobe
/// of two cycles is thus seen once; the count goes into its FIFO.
namespace stamper {
using namespace pio_assembly;
inline constexpr unsigned machine = 2;
inline constexpr Place place{10, 15, 16};
inline constexpr unsigned tick_cycles = 2;
inline constexpr std::array<Code, 7> code{
    mov(To::isr, From::x),  // two cycles for looking and this one make up for...
    push(),
    jump(place.first + 3, When::x_counts_down),  // ...what these three count in three
    jump(place.first + 4, When::x_counts_down),
    jump(place.wrap_bottom, When::x_counts_down),
    jump(place.first, When::pin_is_high),
    jump(place.wrap_bottom, When::x_counts_down),
};
}  // namespace stamper

// Block 1

/// Each combination of exposure lines is the address of an instruction that sets the triggers of
/// slaves, and whether a camera of the light exposes. The pin after the exposure lines reads as
/// low.
namespace router {
using namespace pio_assembly;
inline constexpr unsigned machine = 0;
inline constexpr unsigned size = 1U << firmware::camera_count;
inline constexpr Place place{0, 0, size - 1};
inline constexpr unsigned side_pins = firmware::camera_count + 1;
constexpr Code entry(unsigned levels) {
    return side(mov(To::program_counter, From::pins), side_pins, levels);
}
}  // namespace router

/// The light is on while the gate is open and a camera exposes or the lead is on. Once it was on
/// for as long as the OSR says, it stays off until the gate closes.
namespace light {
using namespace pio_assembly;
inline constexpr unsigned machine = 1;
inline constexpr Place place{router::size, router::size + 11, router::size + 13};
inline constexpr unsigned dark = place.first + 10;
inline constexpr unsigned again = place.first + 11;
inline constexpr unsigned lit = place.first + 8;
inline constexpr unsigned gate = 2;  ///< counts from the exposing pin
/// Y: with three levels behind it, the address of an instruction of the table.
inline constexpr unsigned table = place.first / 8;
inline constexpr unsigned lit_cycles = 5;  ///< of each count of the limit
inline constexpr std::array<Code, 14> code{
    // By gate, lead, exposing:
    optional_side(jump(dark), false),
    optional_side(jump(dark), false),
    optional_side(jump(dark), false),
    optional_side(jump(dark), false),
    optional_side(jump(dark), false),
    optional_side(jump(lit), true),
    optional_side(jump(lit), true),
    optional_side(jump(lit), true),
    // lit:
    optional_side(jump(again, When::x_counts_down), true),
    optional_side(wait_for_pin(false, gate), false),
    // dark:
    mov(To::x, From::osr),
    // again:
    mov(To::isr, From::y),
    in(From::pins, 3),
    mov(To::program_counter, From::isr),
};
}  // namespace light

/// The test output is a copy of an input.
namespace copier {
using namespace pio_assembly;
inline constexpr unsigned machine = 2;
inline constexpr Place place{light::place.wrap_top + 1, light::place.wrap_top + 1,
                             light::place.wrap_top + 1};
inline constexpr std::array<Code, 1> code{mov(To::pins, From::pins)};
}  // namespace copier

static_assert(copier::place.wrap_top < 32 && stamper::place.wrap_top < 32);

}  // namespace versavis::rp2040
