// SPDX-License-Identifier: BSD-3-Clause
// Compares what the service published with what really happened in the rig.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "scenario.hpp"
#include "versavis/error.hpp"

namespace versavis::rig {

struct StreamVerdict {
    std::uint64_t items = 0;
    double rate_hz = 0;
    std::uint64_t lost =
        0;  ///< happened and was sent between the first and the last item, but was not published
    std::uint64_t unpaired = 0;  ///< frames that the service received and withheld
    std::uint64_t wrong_pairs =
        0;  ///< stamps of another exposure or sample, or further off than they claim
    double error_p50_ns = 0;
    double error_p99_ns = 0;
    double error_max_ns = 0;
};

struct Verdict {
    bool ok = false;
    double seconds = 0;
    std::map<std::string, StreamVerdict> streams;
    std::vector<std::string> complaints;
};

struct JudgeSettings {
    std::string instance;
    std::string truth_path;
    double seconds = 10;
    double start_timeout_s = 30;
    std::function<void()> on_second;       ///< called about once a second while it records
    std::function<bool()> stop_requested;  ///< ends the recording early
};

/// Records the streams of `scenario` for the time given, counted from when all of them flow, then
/// compares. Errors: a stream did not start in time; the ground truth cannot be read.
Expected<Verdict> judge(const Scenario& scenario, const JudgeSettings& settings);

std::string to_json(const Verdict& verdict);
std::string to_table(const Verdict& verdict);

}  // namespace versavis::rig
