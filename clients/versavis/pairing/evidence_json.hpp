// SPDX-License-Identifier: BSD-3-Clause
// The evidence of a pairing as JSON, there and back: a line of `versavis tail cam0-evidence
// --json`.
#pragma once

#include <nlohmann/json.hpp>

#include "engine/pairing/recording.hpp"

namespace versavis::client {

nlohmann::json to_json(const pairing::Evidence& evidence);

/// Errors: not evidence, or a field that is missing or of the wrong type.
Expected<pairing::Evidence> to_evidence(const nlohmann::json& line);

}  // namespace versavis::client
