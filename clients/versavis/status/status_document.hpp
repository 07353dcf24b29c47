// SPDX-License-Identifier: BSD-3-Clause
// Reads the service's status document from its ring.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "versavis/stream.hpp"

namespace versavis::client {

/// The newest document of `instance`. Errors: the service is not running, or its document is older
/// than three seconds.
Expected<nlohmann::json> read_status(const std::string& instance);

}  // namespace versavis::client
