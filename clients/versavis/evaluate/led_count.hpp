// SPDX-License-Identifier: BSD-3-Clause
// What the LED timing board shows in a picture: its count, and the instant of the exposure's middle
// within the step.
#pragma once

#include <array>

#include "evaluate/led_board.hpp"

namespace versavis::client {

/// The board repeats after so many steps.
inline constexpr int led_period = 64;
/// Exposures of more steps light all four striding LEDs.
inline constexpr double most_led_steps = 3;

struct LedLayout {
    bool high_bit_first = false;  ///< of the four binary LEDs, seen from the striding ones
    bool backward = false;        ///< the striding LEDs run towards the first LED
    bool binary_first = false;    ///< the place begins at the end with the binary LEDs
};

struct LedReading {
    double phase = 0;       ///< steps at the middle of the exposure, from 0 to below 64
    double half_width = 0;  ///< no step fell into the exposure: phase is right to this; else 0
    /// The phase is known up to multiples of this. While all four binary LEDs change at once, from
    /// 31 to 32 or from 63 to 0, half of one picture looks like half of the other: then it is 32.
    double period = led_period;
    double residual = 0;    ///< RMS of what the levels differ from those of a board
    double confidence = 0;  ///< how likely it is this count, against the next best one
    bool ambiguous = false;
};

/// A difference of phases, from minus half the period to below half of it.
double wrapped_steps(double steps, double period = led_period);

/// `exposure` in steps, above 0 and at most most_led_steps.
LedReading read_leds(const LedLevels& levels, double exposure, const LedLayout& layout);

/// What an exposure that begins at `start`, in steps, shows: what read_leds() inverts.
LedLevels led_levels(double start, double exposure, const LedLayout& layout);

}  // namespace versavis::client
