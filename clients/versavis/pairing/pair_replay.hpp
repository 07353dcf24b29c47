// SPDX-License-Identifier: BSD-3-Clause
// The pairing of a camera, redone from a recording of its evidence.
#pragma once

#include <istream>
#include <ostream>
#include <string>

#include "versavis/error.hpp"

namespace versavis::client {

struct ReplaySummary {
    std::uint64_t frames = 0;
    std::uint64_t paired = 0;
    std::uint64_t frames_without_trigger = 0;
    std::uint64_t triggers_without_frame = 0;
    std::uint64_t records_doubted = 0;
    std::uint64_t locks = 0;
    std::uint64_t slips = 0;
};

/// Reads the lines of `versavis tail CAMERA-evidence --json` and writes each decision to `out`, if
/// it is not null, as one JSON object per line. What precedes the beginning of a stream in the
/// recording is ignored. Errors name the line: not JSON, not evidence; no beginning anywhere.
Expected<ReplaySummary> replay_pairing(std::istream& recording, std::ostream* out);

std::string to_text(const ReplaySummary& summary, bool json);

}  // namespace versavis::client
