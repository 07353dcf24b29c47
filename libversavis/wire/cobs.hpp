// SPDX-License-Identifier: BSD-3-Clause
// Consistent Overhead Byte Stuffing: packets without zero bytes, so that zero delimits them;
// freestanding. Source: Cheshire and Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM
// Transactions on Networking 7(2), 1999.
#pragma once

#include <cstddef>
#include <cstdint>

namespace versavis::wire {

/// Largest encoded size of `size` bytes, without the delimiter.
constexpr std::size_t cobs_bound(std::size_t size) { return size + size / 254 + 1; }

/// Encodes `size` bytes of `data` to `out`, which has room for cobs_bound(size); returns the
/// encoded size. `data` may lie in that room, at least cobs_bound(size) - size bytes from its
/// beginning.
constexpr std::size_t cobs_encode(const std::uint8_t* data, std::size_t size, std::uint8_t* out) {
    constexpr std::ptrdiff_t full_run = 0xFF;  // its code included
    std::uint8_t* code_at = out;
    std::uint8_t* next = out + 1;
    const std::uint8_t* const end = data + size;
    while (data != end) {
        if (next - code_at == full_run) {
            *code_at = full_run;
            code_at = next++;
        }
        // So many bytes fit the run, whatever they are.
        const std::ptrdiff_t room = full_run - (next - code_at);
        const std::uint8_t* const stop = end - data > room ? data + room : end;
        do {
            const std::uint8_t byte = *data++;
            *next = byte;
            if (byte == 0) {
                // The place of a zero is that of the next code.
                *code_at = static_cast<std::uint8_t>(next - code_at);
                code_at = next;
            }
            ++next;
        } while (data != stop);
    }
    *code_at = static_cast<std::uint8_t>(next - code_at);
    return static_cast<std::size_t>(next - out);
}

/// Decodes `size` encoded bytes (no delimiter) to `out` of `capacity` bytes; returns the decoded
/// size, or `cobs_invalid` when the input is malformed or does not fit.
inline constexpr std::size_t cobs_invalid = ~std::size_t{0};

constexpr std::size_t cobs_decode(const std::uint8_t* data, std::size_t size, std::uint8_t* out,
                                  std::size_t capacity) {
    std::size_t written = 0;
    std::size_t i = 0;
    while (i < size) {
        const std::uint8_t code = data[i++];
        if (code == 0 || i + code - 1 > size) return cobs_invalid;
        for (std::uint8_t k = 1; k < code; ++k, ++i) {
            if (data[i] == 0 || written == capacity) return cobs_invalid;
            out[written++] = data[i];
        }
        if (code != 0xFF && i < size) {
            if (written == capacity) return cobs_invalid;
            out[written++] = 0;
        }
    }
    return written;
}

}  // namespace versavis::wire
