// SPDX-License-Identifier: BSD-3-Clause
#include "camera/node_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace versavis::daemon {

namespace {

/// A float has 24 bits.
constexpr double rounding = 2e-7;

std::optional<double> number(const std::string& text) {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    return text.empty() || *end != '\0' ? std::nullopt : std::optional(value);
}

}  // namespace

bool same_value(const std::string& a, const std::string& b) {
    if (a == b) return true;
    const auto x = number(a);
    const auto y = number(b);
    return x && y && std::abs(*x - *y) <= rounding * std::max(std::abs(*x), std::abs(*y));
}

}  // namespace versavis::daemon
