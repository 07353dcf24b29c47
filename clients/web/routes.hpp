// SPDX-License-Identifier: BSD-3-Clause
// Which request gets what.
#pragma once

#include "http.hpp"
#include "live_data.hpp"
#include "settings.hpp"

namespace versavis::web {

Response respond(const Request& request, const Settings& settings, LiveData& data);

}  // namespace versavis::web
