// SPDX-License-Identifier: BSD-3-Clause
// Which request gets what.
#pragma once

#include "http.hpp"
#include "live_data.hpp"
#include "recording_process.hpp"
#include "settings.hpp"

namespace versavis::web {

Response respond(const Request& request, const Settings& settings, LiveData& data,
                 RecordingProcess& recording);

/// Why a request for a WebSocket is not granted; none: it is. Pages of other origins may open
/// sockets, unlike other requests: only those of `settings` may.
std::optional<Response> refuse_viewer(const Request& request, const Settings& settings);

}  // namespace versavis::web
