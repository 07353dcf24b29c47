// SPDX-License-Identifier: BSD-3-Clause
// `versavis verify`: whether the stamps of a recording are right, by all that was recorded, judged
// afterwards by code that shares nothing with the service's.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "verify/recorded_evidence.hpp"
#include "verify/verdict.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

struct Verification {
    std::string file;
    std::vector<StreamVerdict> streams;
    std::int64_t seconds = 0;  ///< of the recording
    std::uint64_t board_lives = 0;
    std::uint64_t exchanges = 0;
    std::uint64_t refused_exchanges = 0;  ///< that the others contradict
    Duration bounds_width;                ///< of host times, usually
    std::vector<std::string> notes;

    /// The worst of all streams; of none: plausible.
    Grade grade() const;
    /// The verdict in one sentence.
    std::string sentence() const;
};

Verification verify(const RecordedEvidence& evidence);

/// `pictures`: of cameras whose pictures were compared with the gyro. Errors: the recording cannot
/// be read or is damaged; stopped.
Expected<Verification> verify_recording(
    const std::string& path, const std::function<bool()>& go_on,
    const std::map<std::string, PictureEvidence>& pictures = {});

nlohmann::json to_json(const Verification& verification);
std::string to_text(const Verification& verification);

/// A page that stands alone: tables, and a time line of each stream.
std::string to_html(const Verification& verification);

}  // namespace versavis::client
