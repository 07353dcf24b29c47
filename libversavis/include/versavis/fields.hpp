// SPDX-License-Identifier: BSD-3-Clause
// What the metadata of an item say, value by value: one table for each kind, for code that prints,
// stores or compares them by name. docs/contracts/shm-layout.md has the same names.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>

#include "versavis/export.hpp"
#include "versavis/ring_layout.hpp"

namespace versavis {

enum class FieldType : std::uint8_t {
    u32,
    u64,
    i32,
    i64,
    f32,
    flag,          ///< bits of a word are set
    tick,          ///< 64 bits of a frame's two words
    text,          ///< zero-terminated
    stamp_kind,    ///< the name of a StampKind
    event_kind,    ///< the name of an EventKind
    event_reason,  ///< the name of an EventReason
    pixel_format,  ///< the name of a PFNC code
};

/// When a value says nothing.
enum class UnknownIf : std::uint8_t { never, zero, ones, nan, without_flag, without_trigger };

struct Field {
    const char* name;      ///< ends with the unit of a time, an angular rate, ...
    std::uint16_t offset;  ///< in the metadata; behind them are a payload's attributes
    FieldType type;
    UnknownIf unknown = UnknownIf::never;
    std::uint8_t since = 0;   ///< minor version of the ring's ABI
    std::uint8_t count = 1;   ///< of a vector: components
    std::uint32_t flags = 0;  ///< bits of a flag, or those without which the value is unknown
};

struct Fields {
    const Field* first = nullptr;
    std::size_t count = 0;
    const Field* begin() const { return first; }
    const Field* end() const { return first + count; }
};

/// Of frames, IMU samples, events and sentences; none of other kinds.
VERSAVIS_API Fields fields_of(ring::StreamKind kind);

/// None: unknown.
using FieldValue =
    std::variant<std::monostate, bool, std::int64_t, std::uint64_t, float, std::string>;

/// `attributes`: of the item's payload. `component`: of a vector.
VERSAVIS_API FieldValue value_of(const Field& field, const ring::Metadata& metadata,
                                 std::uint64_t attributes, unsigned component = 0);

}  // namespace versavis
