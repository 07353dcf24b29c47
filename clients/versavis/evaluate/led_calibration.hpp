// SPDX-License-Identifier: BSD-3-Clause
// What each LED of a board shows when it is off and when it is on, from the pictures themselves.
#pragma once

#include <vector>

#include "evaluate/led_report.hpp"

namespace versavis::client {

/// The same pictures, their levels such that each LED shows 0 while it is off and 1 while it is on:
/// what lies behind it, or shines on it, is taken off, and LEDs may differ in brightness. An LED
/// that is not seen in both states stays as it is.
std::vector<LedObservation> calibrated_leds(std::vector<LedObservation> shots, double rate_hz,
                                            const LedLayout& layout);

}  // namespace versavis::client
