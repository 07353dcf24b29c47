// SPDX-License-Identifier: BSD-3-Clause
// The connection of a viewer that speaks Foxglove's protocol.
#pragma once

#include <boost/beast/core/tcp_stream.hpp>
#include <memory>

#include "http.hpp"
#include "live_data.hpp"
#include "settings.hpp"

namespace versavis::web {

/// Answers the request for a WebSocket, and serves it, by the stream's executor, until it ends;
/// `settings` and `data` are there as long. `place` is held until then.
void serve_viewer(boost::beast::tcp_stream stream, Request request, const Settings& settings,
                  LiveData& data, std::shared_ptr<void> place);

}  // namespace versavis::web
