// SPDX-License-Identifier: BSD-3-Clause
// The status document as the one line that Nagios, Icinga and others want of a plugin.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "versavis/error.hpp"

namespace versavis::client {

/// Exit codes of a plugin.
enum class CheckState { ok = 0, warning = 1, critical = 2, unknown = 3 };

struct CheckResult {
    CheckState state = CheckState::unknown;
    std::string line;  ///< "VERSAVIS OK - ... | performance data", without a line end
};

/// Critical: a camera or an IMU delivers nothing. Warning: something else is wrong. Unknown: a
/// start is in progress.
CheckResult check_status(const nlohmann::json& status);

/// Of a status that cannot be read: critical if there is no living service, unknown otherwise.
CheckResult check_failed(const Error& error, bool may_live);

}  // namespace versavis::client
