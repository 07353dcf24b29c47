// SPDX-License-Identifier: BSD-3-Clause
// Packets between board and host, as somebody reads them who has docs/contracts/wire-protocol.md
// and nothing else: the tool that lies also shows that the document is enough.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace versavis::liar {

using Bytes = std::vector<std::uint8_t>;

enum class Type : std::uint8_t {
    board_hello = 0x01,
    exposure = 0x02,
    imu_sample = 0x03,
    event = 0x04,
    clock_answer = 0x05,
    health = 0x06,
    log = 0x07,
    clock_follow_up = 0x0A,
};

struct Packet {
    Type type{};
    std::uint32_t nonce = 0;
    std::uint32_t sequence = 0;
    Bytes payload;
};

/// A little-endian number within a payload.
struct Field {
    std::string_view name;
    unsigned offset;
    unsigned size;  ///< bytes: 1, 2, 4 or 8

    friend bool operator==(const Field& a, const Field& b) { return a.offset == b.offset; }
};

namespace exposure {
inline constexpr Field camera{"camera", 0, 1};
inline constexpr Field flags{"flags", 2, 2};
inline constexpr Field trigger{"trigger", 8, 8};
inline constexpr Field tick{"tick", 16, 8};
inline constexpr Field trigger_time{"trigger time", 24, 8};
inline constexpr Field start{"start", 32, 8};
inline constexpr Field end{"end", 40, 8};
}  // namespace exposure

namespace imu_sample {
inline constexpr Field flags{"flags", 2, 2};
inline constexpr Field number{"number", 4, 4};
inline constexpr Field time{"time", 8, 8};
inline constexpr Field magnetic_x{"magnetic x", 40, 2};
inline constexpr Field magnetic_y{"magnetic y", 42, 2};
inline constexpr Field accel_age{"accel age", 50, 2};
inline constexpr Field age{"age", 52, 4};
}  // namespace imu_sample

namespace event {
inline constexpr Field detail{"detail", 2, 2};
inline constexpr Field sequence{"sequence", 4, 4};
inline constexpr Field time{"time", 8, 8};
inline constexpr Field value{"value", 16, 8};
}  // namespace event

namespace clock_answer {
inline constexpr Field id{"id", 0, 4};
inline constexpr Field received{"received", 8, 8};
inline constexpr Field sent{"sent", 16, 8};
}  // namespace clock_answer

namespace clock_follow_up {
inline constexpr Field id{"id", 0, 4};
inline constexpr Field sent{"sent", 8, 8};
}  // namespace clock_follow_up

inline constexpr Field board_hello_time{"board time", 8, 8};
inline constexpr Field health_time{"board time", 0, 8};

/// The instant that was not observed.
inline constexpr std::int64_t unobserved = INT64_MIN;

/// The number at a field; unsigned types of less than 64 bits are not sign-extended.
std::int64_t get(const Packet& packet, const Field& field);
void set(Packet& packet, const Field& field, std::int64_t value);

/// Every field of a type that holds an instant of the board's clock.
std::vector<Field> instants(Type type);

/// `encoded` is what stood between two zero bytes. Nothing if it is no valid packet.
std::optional<Packet> decode(std::span<const std::uint8_t> encoded);

/// With the right CRC and the final zero.
Bytes encode(const Packet& packet);

}  // namespace versavis::liar
