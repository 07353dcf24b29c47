// SPDX-License-Identifier: BSD-3-Clause
// Items of the ring `clock` as JSON.
#pragma once

#include <nlohmann/json.hpp>

#include "engine/clock/recording.hpp"

namespace versavis::client {

nlohmann::json to_json(const clock::ClockItem& item);

}  // namespace versavis::client
