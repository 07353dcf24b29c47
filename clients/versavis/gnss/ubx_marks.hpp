// SPDX-License-Identifier: BSD-3-Clause
// Time marks of a u-blox receiver: edges at its EXTINT pin, as its messages UBX-TIM-TM2 report them
// (ZED-F9P interface description, UBX-18010854).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace versavis::client {

inline constexpr std::int64_t gps_week_ns = 604'800'000'000'000;

enum class MarkEdge { rising, falling };

/// What a mark's time counts in.
/// GNSS time is that of the system that the receiver is set to.
enum class TimeBase : std::uint8_t { receiver = 0, gnss = 1, utc = 2 };

struct TimeMark {
    std::int64_t time_ns = 0;  ///< since 1980-01-06 0:00, in the time of `base`
    std::uint32_t accuracy_ns = 0;
    std::uint16_t count = 0;  ///< rising edges since the receiver's start, modulo 2^16
    std::uint8_t channel = 0;
    TimeBase base = TimeBase::receiver;
    bool valid = false;  ///< the receiver knew the time
};

struct UbxMarks {
    std::vector<TimeMark> marks;
    std::uint64_t messages = 0;  ///< of all kinds
    std::uint64_t damaged = 0;   ///< the checksum is wrong
};

/// Reads a receiver's output; what is no UBX message, as NMEA and RTCM, is passed over.
UbxMarks read_time_marks(std::span<const std::byte> bytes, MarkEdge edge);

}  // namespace versavis::client
