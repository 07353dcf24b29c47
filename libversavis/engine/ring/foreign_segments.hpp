// SPDX-License-Identifier: BSD-3-Clause
// The rings that other processes made in an instance's directory, and which of them are in use.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "client/segment.hpp"
#include "versavis/error.hpp"

namespace versavis::ring {

struct ForeignSegment {
    std::filesystem::path path;
    Mapping mapping;
    bool alive = false;  ///< its writer is
};

/// What `open` opens in `directory`, but for this process's own. Where only its heartbeat can
/// show that a writer lives, the next one is waited for: 1.1 s at most.
std::vector<ForeignSegment> foreign_segments(
    const std::filesystem::path& directory,
    const std::function<Expected<Mapping>(const std::filesystem::path&)>& open);

}  // namespace versavis::ring
