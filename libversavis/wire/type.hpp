// SPDX-License-Identifier: BSD-3-Clause
// Numbers of the packet types between board and host, and what all of them share; freestanding
// C++17.
#pragma once

#include <cstddef>
#include <cstdint>

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "the wire structs are copied as they lie in memory");

namespace versavis::wire {

inline constexpr std::uint8_t protocol_major = 3;
inline constexpr std::uint8_t protocol_minor = 3;
inline constexpr std::size_t camera_count = 4;

/// `no_time` in a time field: the instant was not observed.
inline constexpr std::int64_t no_time = INT64_MIN;

enum class Type : std::uint8_t {
    board_hello = 0x01,
    exposure = 0x02,
    imu_sample = 0x03,
    event = 0x04,
    clock_answer = 0x05,
    health = 0x06,
    log = 0x07,
    configuration_answer = 0x08,
    refusal = 0x09,
    clock_follow_up = 0x0A,
    sentence = 0x0B,
    host_hello = 0x81,
    configuration = 0x82,
    start = 0x83,
    stop = 0x84,
    clock_request = 0x85,
    expected_exposure = 0x86,
    reboot = 0x87,
    align_grid = 0x88,
    time_output = 0x89,
};

}  // namespace versavis::wire
