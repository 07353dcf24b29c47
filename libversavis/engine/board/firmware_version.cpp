// SPDX-License-Identifier: BSD-3-Clause
#include "engine/board/firmware_version.hpp"

#include <array>
#include <charconv>
#include <optional>

namespace versavis::board {

namespace {

using Version = std::array<unsigned, 3>;

/// What follows the third number, as in "1.2.3-rc1", is left out.
std::optional<Version> parse(std::string_view text) {
    Version version{};
    const char* at = text.data();
    const char* const end = at + text.size();
    for (std::size_t i = 0; i < version.size(); ++i) {
        if (i > 0 && (at == end || *at++ != '.')) return std::nullopt;
        const auto [next, error] = std::from_chars(at, end, version[i]);
        if (error != std::errc()) return std::nullopt;
        at = next;
    }
    return version;
}

}  // namespace

bool is_older(std::string_view firmware, std::string_view release) {
    const auto space = firmware.rfind(' ');
    if (space == std::string_view::npos) return false;
    const auto theirs = parse(firmware.substr(space + 1));
    const auto ours = parse(release);
    return theirs && ours && *theirs < *ours;
}

}  // namespace versavis::board
