// SPDX-License-Identifier: BSD-3-Clause
// Units of the firmware's times.
#pragma once

#include "base/hal.hpp"

namespace versavis::test {

inline constexpr firmware::Nanoseconds us = 1'000;
inline constexpr firmware::Nanoseconds ms = 1'000'000;
inline constexpr firmware::Nanoseconds second = 1'000'000'000;

}  // namespace versavis::test
