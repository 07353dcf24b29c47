// SPDX-License-Identifier: BSD-3-Clause
// Writes all that can be read of a damaged MCAP file, ours or not, into a new one with an index.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "recording/mcap_reader.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

struct Salvage {
    std::uint64_t messages = 0;
    std::uint64_t chunks = 0;
    std::vector<std::string> left_out;  ///< each with its place in the old file
};

/// Errors: `path` is there already, the disk is full, a chunk's compression is unknown. Then there
/// is no `path`.
Expected<Salvage> salvage(const McapReader& from, const std::string& path);

}  // namespace versavis::client
