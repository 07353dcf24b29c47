// SPDX-License-Identifier: BSD-3-Clause
// Recomputes a recording: frames are paired again, all stamps come from the smoothed clock.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

/// What became of one stream of frames or samples.
struct ProcessedStream {
    std::uint64_t items = 0;
    std::uint64_t restamped = 0;
    std::uint64_t suspect = 0;       ///< as recorded
    std::uint64_t proved = 0;        ///< of these: they have their stamps now
    std::uint64_t contradicted = 0;  ///< published as proved, but paired otherwise now: unchanged
    double change_rms_ns = 0;        ///< of stamps that were proved before
    double change_max_ns = 0;
    double sigma_after_ns = 0;  ///< mean of the recomputed ones
};

struct ProcessReport {
    std::string file;
    std::map<std::string, ProcessedStream> streams;
    std::vector<std::string> notes;
};

/// Errors: the recording cannot be read, is damaged or has no clock; `output` is there already;
/// stopped. Then there is no `output`.
Expected<ProcessReport> process_recording(const std::string& path, const std::string& output,
                                          const std::function<bool(double share)>& go_on);

nlohmann::json to_json(const ProcessReport& report);
std::string to_text(const ProcessReport& report);

}  // namespace versavis::client
