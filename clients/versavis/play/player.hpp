// SPDX-License-Identifier: BSD-3-Clause
// Publishes a recording as rings again, so that each client works on recordings unchanged.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "recording/recording.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

struct PlaySettings {
    std::string instance;
    std::vector<std::string> streams;  ///< empty: all
    double rate = 1;                   ///< Playback speed factor (2 = twice real time)
    bool loop = false;
    std::function<bool()> stop;
    std::function<void(double seconds, double all)> progress;  ///< within the recording
};

struct PlayReport {
    std::uint64_t items = 0;
    std::uint64_t without_pixels = 0;  ///< frames that could not be published
    Duration latest;                   ///< by how much the latest item was late
    std::uint64_t rounds = 0;
};

/// Plays until its end, or, in a loop, until stopped. Each round has a life of its own. Errors: a
/// service runs in this instance, no such stream, no memory, the recording is damaged.
Expected<PlayReport> play(const Recording& recording, const PlaySettings& settings);

}  // namespace versavis::client
