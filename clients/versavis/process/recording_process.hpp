// SPDX-License-Identifier: BSD-3-Clause
// Recomputes a recording: frames are paired again, and stamps come from the smoothed clock where
// that is better.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "process/stamp_choice.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// What became of the stamps of one stream within one epoch.
struct ProcessedEpoch {
    std::uint64_t life = 0;  ///< of the service
    std::uint32_t epoch = 0;
    std::uint64_t items = 0;
    std::array<std::uint64_t, 6> stamps{};  ///< by Choice, but for those proved
    std::uint64_t proved = 0;               ///< suspect frames that have their stamps now
    double sigma_before_ns = 0;             ///< mean of the improved ones
    double sigma_after_ns = 0;

    std::uint64_t improved() const { return stamps[static_cast<std::size_t>(Choice::improved)]; }
};

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
    std::vector<ProcessedEpoch> epochs;
};

struct ProcessReport {
    std::string file;
    std::map<std::string, ProcessedStream> streams;
    std::vector<std::string> notes;
};

/// A recording of before version 2 becomes one of today. Without a clock all stamps stay. Errors:
/// the recording cannot be read or is damaged; `output` is there already;
/// stopped. Then there is no `output`.
Expected<ProcessReport> process_recording(const std::string& path, const std::string& output,
                                          const std::function<bool(double share)>& go_on);

nlohmann::json to_json(const ProcessReport& report);
std::string to_text(const ProcessReport& report);

}  // namespace versavis::client
