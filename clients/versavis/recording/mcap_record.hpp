// SPDX-License-Identifier: BSD-3-Clause
// The bytes of MCAP records: little-endian fields, text and maps behind their length.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <type_traits>

#include "recording/mcap_reader.hpp"

namespace versavis::client {

template <class T>
std::string mcap_number(T value) {
    static_assert(std::is_arithmetic_v<T>);
    return {reinterpret_cast<const char*>(&value), sizeof value};
}

/// Behind its length in bytes; so are maps and arrays, whose entries are given.
inline std::string mcap_text(const std::string& value) {
    return mcap_number(static_cast<std::uint32_t>(value.size())) + value;
}

inline std::string mcap_map(const std::map<std::string, std::string>& map) {
    std::string entries;
    for (const auto& [key, value] : map) entries += mcap_text(key) + mcap_text(value);
    return mcap_text(entries);
}

inline std::string mcap_record_head(McapOpcode opcode, std::uint64_t length) {
    return mcap_number(static_cast<std::uint8_t>(opcode)) + mcap_number(length);
}

inline std::string mcap_record(McapOpcode opcode, const std::string& content) {
    return mcap_record_head(opcode, content.size()) + content;
}

inline const std::string mcap_magic("\x89MCAP0\r\n", 8);

}  // namespace versavis::client
