// SPDX-License-Identifier: BSD-3-Clause
// The streams of an instance.
#pragma once

#include <string>

#include "versavis/error.hpp"

namespace versavis::client {

/// One line per stream, or a JSON array. Error: the service is not running here.
Expected<std::string> list_streams(const std::string& instance, bool json);

}  // namespace versavis::client
