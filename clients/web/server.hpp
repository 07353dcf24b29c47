// SPDX-License-Identifier: BSD-3-Clause
// Accepts connections and answers requests, all in the thread that runs the context. A client that
// is slow, says nothing or sends too much is let go; when there are too many, those go first that
// have been silent longest.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <functional>
#include <memory>
#include <string>

#include "http.hpp"
#include "versavis/error.hpp"

namespace versavis::web {

class Server {
 public:
    struct Handlers {
        std::function<Response(const Request&)> respond;
        /// Takes a connection over that asks for a WebSocket; `place` is held until it ends.
        std::function<void(boost::beast::tcp_stream, Request, std::shared_ptr<void> place)> upgrade;
    };

    /// Errors: no such address, or its port is in use.
    static Expected<Server> listen(boost::asio::io_context& context, const std::string& address,
                                   std::uint16_t port);

    boost::asio::ip::tcp::endpoint endpoint() const { return endpoint_; }

    /// From here on they answer, until the context stops.
    void start(const Handlers& handlers);

 private:
    Server(boost::asio::ip::tcp::acceptor acceptor, boost::asio::ip::tcp::endpoint endpoint)
        : acceptor_(std::move(acceptor)), endpoint_(std::move(endpoint)) {}

    boost::asio::ip::tcp::acceptor acceptor_;
    boost::asio::ip::tcp::endpoint endpoint_;
};

}  // namespace versavis::web
