// SPDX-License-Identifier: BSD-3-Clause
// The connection of a viewer that speaks Foxglove's protocol.
#pragma once

#include <utility>  // which asio 1.74 does not include by itself

#include <boost/asio/awaitable.hpp>
#include <boost/beast/core/tcp_stream.hpp>

#include "http.hpp"
#include "live_data.hpp"
#include "settings.hpp"

namespace versavis::web {

/// Answers the request for a WebSocket, and serves it until it ends.
boost::asio::awaitable<void> serve_viewer(boost::beast::tcp_stream& stream, Request request,
                                          const Settings& settings, LiveData& data);

}  // namespace versavis::web
