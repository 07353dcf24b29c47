// SPDX-License-Identifier: BSD-3-Clause
// What a board says of itself, in the words of the status document.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "wire/messages.hpp"

namespace versavis::board {

/// Bits of wire::Present that have a name.
inline constexpr std::size_t part_count = 19;
static_assert((1U << part_count) - 1U == wire::present_all);

/// Names of the bits of wire::Present that are set.
std::vector<std::string> part_names(std::uint32_t present);

/// Of a message: zeros at its end are no part of it.
template <std::size_t size>
std::string text(const char (&padded)[size]) {
    return {padded, strnlen(padded, size)};
}

const char* to_string(wire::ResetCause cause);
const char* to_string(wire::PpsState state);
const char* to_string(wire::SyncState state);
const char* to_string(wire::StampTest test);

}  // namespace versavis::board
