// SPDX-License-Identifier: BSD-3-Clause
// Instructions of the RP2040's programmable I/O, as values.
#pragma once

#include <cstdint>

namespace versavis::rp2040::pio_assembly {

using Code = std::uint16_t;

enum class When : std::uint16_t {
    always = 0,
    x_is_zero = 1,
    x_counts_down = 2,
    y_is_zero = 3,
    y_counts_down = 4,
    x_differs_from_y = 5,
    pin_is_high = 6,
};

enum class From : std::uint16_t { pins = 0, x = 1, y = 2, isr = 6, osr = 7 };
enum class To : std::uint16_t {
    pins = 0,
    x = 1,
    y = 2,
    null = 3,            ///< of out()
    pin_directions = 4,  ///< of out() and set()
    program_counter = 5,
    isr = 6,
    osr = 7,  ///< of mov()
};

constexpr Code word(unsigned operation, unsigned high, unsigned low) {
    return static_cast<Code>(operation << 13U | high << 5U | (low & 31U));
}

constexpr Code jump(unsigned to, When when = When::always) {
    return word(0, static_cast<unsigned>(when), to);
}
/// `pin` counts from the machine's first input pin.
constexpr Code wait_for_pin(bool level, unsigned pin) {
    return word(1, (level ? 4U : 0U) | 1U, pin);
}
constexpr Code in(From from, unsigned bits) { return word(2, static_cast<unsigned>(from), bits); }
constexpr Code out(To to, unsigned bits) { return word(3, static_cast<unsigned>(to), bits); }
/// Waits for a word.
constexpr Code pull() { return word(4, 5, 0); }
/// Without a word, the contents of X count as one.
constexpr Code pull_or_x() { return word(4, 4, 0); }
constexpr Code mov(To to, From from) {
    return word(5, static_cast<unsigned>(to), static_cast<unsigned>(from));
}
constexpr Code mov_inverted(To to, From from) {
    return word(5, static_cast<unsigned>(to), 1U << 3U | static_cast<unsigned>(from));
}
constexpr Code raise_flag(unsigned flag) { return word(6, 0, flag); }
constexpr Code set(To to, unsigned value) { return word(7, static_cast<unsigned>(to), value); }

/// With `bits` side-set pins, all of which the instruction sets.
constexpr Code side(Code code, unsigned bits, unsigned levels) {
    return static_cast<Code>(code | levels << (13U - bits));
}
/// With one side-set pin that an instruction may also leave as it is.
constexpr Code optional_side(Code code, bool level) {
    return static_cast<Code>(code | 1U << 12U | (level ? 1U << 11U : 0U));
}

}  // namespace versavis::rp2040::pio_assembly
