// SPDX-License-Identifier: BSD-3-Clause
// Sensor words from the bytes of a transfer, and rates from a table.
#pragma once

#include <cstddef>
#include <cstdint>

namespace versavis::firmware {

inline std::uint16_t big_endian(const std::uint8_t* bytes, std::size_t word) {
    return static_cast<std::uint16_t>(bytes[2 * word] << 8U | bytes[2 * word + 1]);
}

inline std::uint16_t little_endian(const std::uint8_t* bytes, std::size_t word) {
    return static_cast<std::uint16_t>(bytes[2 * word + 1] << 8U | bytes[2 * word]);
}

inline std::int16_t signed_word(std::uint16_t word) { return static_cast<std::int16_t>(word); }

struct RateCode {
    std::uint32_t millihertz;
    std::uint8_t code;
};

/// The slowest entry not below `wanted_millihertz`, or the first; entries from fast to slow.
template <std::size_t N>
const RateCode& slowest_not_below(const RateCode (&rates)[N], std::uint32_t wanted_millihertz) {
    const RateCode* found = rates;
    for (const RateCode& rate : rates)
        if (rate.millihertz >= wanted_millihertz) found = &rate;
    return *found;
}

}  // namespace versavis::firmware
