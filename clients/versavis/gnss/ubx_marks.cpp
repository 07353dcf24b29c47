// SPDX-License-Identifier: BSD-3-Clause
#include "gnss/ubx_marks.hpp"

#include <optional>

#include "base/byte_cursor.hpp"

namespace versavis::client {

namespace {

constexpr std::byte sync_first{0xB5};
constexpr std::byte sync_second{0x62};
constexpr std::size_t head_size = 6;  ///< sync, class, identity, length
constexpr std::size_t checksum_size = 2;
constexpr std::byte class_tim{0x0D};
constexpr std::byte identity_tm2{0x03};
constexpr std::size_t tm2_size = 28;

enum Tm2Flag : std::uint8_t {
    new_falling = 1U << 2U,
    time_valid = 1U << 6U,
    new_rising = 1U << 7U,
};
constexpr unsigned time_base_shift = 3;
constexpr unsigned time_base_mask = 3;

constexpr std::int64_t ms_ns = 1'000'000;

/// Of 8 bits, by Fletcher (RFC 1145).
bool has_right_checksum(std::span<const std::byte> message) {
    unsigned a = 0;
    unsigned b = 0;
    for (const std::byte byte : message.subspan(2, message.size() - 2 - checksum_size)) {
        a = (a + std::to_integer<unsigned>(byte)) & 0xFFU;
        b = (b + a) & 0xFFU;
    }
    return message[message.size() - 2] == std::byte(a) && message.back() == std::byte(b);
}

/// None: no new edge of this kind.
std::optional<TimeMark> parse_tm2(std::span<const std::byte> payload, MarkEdge edge) {
    ByteCursor cursor(payload);
    TimeMark mark;
    mark.channel = cursor.number<std::uint8_t>();
    const auto flags = cursor.number<std::uint8_t>();
    mark.count = cursor.number<std::uint16_t>();
    const std::int64_t weeks[] = {cursor.number<std::uint16_t>(), cursor.number<std::uint16_t>()};
    std::int64_t times[2];
    for (std::int64_t& time : times) {
        time = cursor.number<std::uint32_t>() * ms_ns;
        time += cursor.number<std::uint32_t>();
    }
    mark.accuracy_ns = cursor.number<std::uint32_t>();
    if ((flags & (edge == MarkEdge::rising ? new_rising : new_falling)) == 0) return std::nullopt;
    const auto which = static_cast<std::size_t>(edge);
    mark.time_ns = weeks[which] * gps_week_ns + times[which];
    mark.base = static_cast<TimeBase>(flags >> time_base_shift & time_base_mask);
    mark.valid = (flags & time_valid) != 0 && mark.base <= TimeBase::utc;
    return mark;
}

}  // namespace

UbxMarks read_time_marks(std::span<const std::byte> bytes, MarkEdge edge) {
    UbxMarks found;
    for (std::size_t at = 0; at + head_size + checksum_size <= bytes.size();) {
        if (bytes[at] != sync_first || bytes[at + 1] != sync_second) {
            ++at;
            continue;
        }
        const std::size_t length = std::to_integer<std::size_t>(bytes[at + 4]) |
                                   std::to_integer<std::size_t>(bytes[at + 5]) << 8U;
        const std::size_t size = head_size + length + checksum_size;
        if (size > bytes.size() - at || !has_right_checksum(bytes.subspan(at, size))) {
            // Its length may be what is damaged: the next message may begin within it.
            ++found.damaged;
            at += 2;
            continue;
        }
        ++found.messages;
        if (bytes[at + 2] == class_tim && bytes[at + 3] == identity_tm2 && length == tm2_size)
            if (const auto mark = parse_tm2(bytes.subspan(at + head_size, length), edge))
                found.marks.push_back(*mark);
        at += size;
    }
    return found;
}

}  // namespace versavis::client
