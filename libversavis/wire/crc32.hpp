// SPDX-License-Identifier: BSD-3-Clause
// CRC-32/ISO-HDLC of the wire's packets; freestanding, shared by board and host.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace versavis::wire {

namespace detail {
constexpr std::array<std::uint32_t, 256> make_crc32_table() {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t byte = 0; byte < 256; ++byte) {
        std::uint32_t remainder = byte;
        for (int bit = 0; bit < 8; ++bit)
            remainder = (remainder & 1U) != 0 ? (remainder >> 1U) ^ 0xEDB88320U : remainder >> 1U;
        table[byte] = remainder;
    }
    return table;
}
inline constexpr auto crc32_table = make_crc32_table();
}  // namespace detail

/// CRC-32 with reflected polynomial 0xEDB88320, initial value and final exclusive-or 0xFFFFFFFF.
constexpr std::uint32_t crc32(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    const std::uint8_t* const end = data + size;
    std::uint32_t crc = 0xFFFFFFFFU;
    do crc = detail::crc32_table[(crc ^ *data++) & 0xFFU] ^ (crc >> 8U);
    while (data != end);
    return ~crc;
}

}  // namespace versavis::wire
