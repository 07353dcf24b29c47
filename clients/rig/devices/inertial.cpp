// SPDX-License-Identifier: BSD-3-Clause
#include "inertial.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::devices {

std::int64_t UpdateTimes::index_at(Nanoseconds at) const {
    auto index =
        static_cast<std::int64_t>(std::floor(static_cast<double>(at - origin) / period_ns));
    while (time(index + 1) <= at) ++index;
    while (time(index) > at) --index;
    return index;
}

Nanoseconds UpdateTimes::time(std::int64_t index) const {
    return origin + std::llround(static_cast<double>(index) * period_ns);
}

std::int16_t counts(double value, double lsb) {
    return static_cast<std::int16_t>(std::clamp(std::round(value / lsb), -32768.0, 32767.0));
}

}  // namespace versavis::devices
