// SPDX-License-Identifier: BSD-3-Clause
// What sources with coroutines of asio need.
#pragma once

#include <utility>  // which awaitable.hpp of asio 1.74 forgets

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/error.hpp>

namespace versavis::web {

/// What an operation completes with, so that its failure is no exception.
inline auto into(boost::beast::error_code& error) {
    return boost::asio::redirect_error(boost::asio::use_awaitable, error);
}

}  // namespace versavis::web
