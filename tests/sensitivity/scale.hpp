// SPDX-License-Identifier: BSD-3-Clause
// Constants that one environment variable scales. Only the rewritten copy of the sources that the
// script sensitivity.py makes includes this.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string_view>
#include <type_traits>

// A constant that becomes a variable is compared with its sign.
#pragma GCC diagnostic ignored "-Wsign-compare"

namespace versavis::sensitivity {

/// The factor for this constant by VERSAVIS_SCALE=<file>:<name>=<factor>; 1 for all others.
inline double factor_of(std::string_view constant) {
    const char* const setting = std::getenv("VERSAVIS_SCALE");
    if (setting == nullptr) return 1;
    const std::string_view text = setting;
    const std::size_t equals = text.rfind('=');
    if (equals == std::string_view::npos || text.substr(0, equals) != constant) return 1;
    return std::strtod(setting + equals + 1, nullptr);
}

/// Integers are rounded, and stay at 1 at least when they were; durations are scaled in ns.
template <class T>
T scaled(std::string_view constant, T value) {
    const double factor = factor_of(constant);
    if (factor == 1) return value;
    if constexpr (std::is_floating_point_v<T>) {
        return static_cast<T>(value * factor);
    } else if constexpr (std::is_integral_v<T>) {
        const long long rounded = std::llround(static_cast<double>(value) * factor);
        return static_cast<T>(value > 0 ? std::max(rounded, 1LL) : rounded);
    } else {
        return T{std::llround(static_cast<double>(value.ns) * factor)};
    }
}

}  // namespace versavis::sensitivity
