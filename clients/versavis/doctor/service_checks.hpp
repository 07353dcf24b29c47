// SPDX-License-Identifier: BSD-3-Clause
// The service: whether it lives and what it says is wrong, its release and its board's, and who
// else wants its devices.
#pragma once

#include <nlohmann/json.hpp>

#include "doctor/finding.hpp"
#include "doctor/subject.hpp"

namespace versavis::client {

Findings check_service(const Subject& subject);

/// Whether the synchronisation is right, and by which figures of the service.
Conclusion conclude(const Subject& subject);

/// The same of the service's status document.
Conclusion conclude(const nlohmann::json& status);

}  // namespace versavis::client
