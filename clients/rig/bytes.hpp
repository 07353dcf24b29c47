// SPDX-License-Identifier: BSD-3-Clause
// Numbers in packets and registers, in either order of their bytes.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace versavis::rig {

inline std::uint64_t load_number(std::span<const std::uint8_t> bytes, std::endian order) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i)
        value = value << 8U | bytes[order == std::endian::big ? i : bytes.size() - 1 - i];
    return value;
}

inline void store_number(std::span<std::uint8_t> bytes, std::uint64_t value, std::endian order) {
    for (std::size_t i = 0; i < bytes.size(); ++i, value >>= 8U)
        bytes[order == std::endian::big ? bytes.size() - 1 - i : i] =
            static_cast<std::uint8_t>(value);
}

inline void append_number(std::vector<std::uint8_t>& out, std::uint64_t value, std::size_t size,
                          std::endian order) {
    out.resize(out.size() + size);
    store_number(std::span(out).last(size), value, order);
}

}  // namespace versavis::rig
