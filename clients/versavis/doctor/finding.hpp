// SPDX-License-Identifier: BSD-3-Clause
// What one check of `versavis doctor` found: the measured value, whether it is right, and the
// command that cures it.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace versavis::client {

enum class Verdict {
    good,
    unknown,  ///< it could not be measured, or nothing here says whether it is right
    warning,  ///< it works, and could work better
    bad,
};
const char* to_string(Verdict verdict);

/// A value of the kernel that may be changed while everything runs, and is back after a reboot.
struct Fix {
    std::string file;  ///< below /proc or /sys
    std::string content;
};

struct Finding {
    std::string check;    ///< one word, as `mtu`
    std::string subject;  ///< the device, link or path; empty: the host
    std::string value;    ///< as measured, with its unit
    Verdict verdict = Verdict::good;
    std::string reason{};  ///< why it is not good; empty if it is
    std::string cure{};    ///< a command, or what else to do
    std::optional<Fix> fix{};
    bool fixed = false;
};

using Findings = std::vector<Finding>;

/// What the whole comes to.
struct Conclusion {
    enum class State { right, wrong, unknown };
    State state = State::unknown;
    std::string sentence;
};
const char* to_string(Conclusion::State state);

/// Of a table for people: a line for each finding, and its reason and cure below it.
std::string report_text(const Findings& findings, const Conclusion& conclusion);

/// docs/contracts/doctor-report.md.
std::string report_json(const Findings& findings, const Conclusion& conclusion);

}  // namespace versavis::client
