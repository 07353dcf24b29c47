// SPDX-License-Identifier: BSD-3-Clause
#include "server.hpp"

#include <fmt/format.h>

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <cstddef>
#include <list>
#include <memory>

#include "coroutine.hpp"

namespace versavis::web {

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using asio::ip::tcp;

/// A browser opens six; a thousand descriptors are what a process may have by default.
constexpr std::size_t most_connections = 400;
constexpr std::uint32_t most_header_bytes = 8192;
constexpr std::uint64_t most_body_bytes = 4096;
/// For a request once it has begun, for the next one of a connection, and to take an answer.
constexpr std::chrono::seconds patience{10};
/// Before it tries again to accept, without a descriptor for that.
constexpr std::chrono::milliseconds pause{100};

/// The connections that there are. In one that waits for a request, nothing is lost: when there are
/// too many, the one that has waited longest ends.
struct Connections {
    std::size_t count = 0;
    std::list<beast::tcp_stream*> waiting{};

    /// False: all of them are being answered.
    bool make_place() {
        if (count < most_connections) return true;
        if (waiting.empty()) return false;
        waiting.front()->close();
        waiting.pop_front();
        return true;
    }
};

/// One of them, from when it is accepted until it ends.
class Place {
 public:
    explicit Place(std::shared_ptr<Connections> all) : all_(std::move(all)) { ++all_->count; }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    ~Place() { --all_->count; }

    void wait(beast::tcp_stream& stream) { all_->waiting.push_back(&stream); }
    void go_on(beast::tcp_stream& stream) { all_->waiting.remove(&stream); }

 private:
    std::shared_ptr<Connections> all_;
};

asio::awaitable<void> converse(beast::tcp_stream stream, Server::Handlers handlers,
                               std::shared_ptr<Place> place) {
    beast::flat_buffer buffer;
    for (bool again = true; again;) {
        http::request_parser<http::string_body> parser;
        parser.header_limit(most_header_bytes);
        parser.body_limit(most_body_bytes);
        stream.expires_after(patience);
        beast::error_code error;
        place->wait(stream);
        co_await http::async_read(stream, buffer, parser, into(error));
        place->go_on(stream);
        // Who speaks no HTTP is answered; who is gone, or says nothing, is not.
        if (error && error.category() != http::make_error_code({}).category()) break;
        if (error == http::error::end_of_stream || error == http::error::partial_message) break;
        if (!error && beast::websocket::is_upgrade(parser.get())) {
            handlers.upgrade(std::move(stream), parser.release(), place);
            co_return;
        }
        Response response = error ? refusal(parser.get(), http::status::bad_request,
                                            "no request: " + error.message())
                                  : handlers.respond(parser.get());
        again = !error && response.keep_alive();
        response.keep_alive(again);
        stream.expires_after(patience);
        http::response_serializer<http::string_body> serializer(response);
        if (parser.get().method() == http::verb::head)
            co_await http::async_write_header(stream, serializer, into(error));
        else
            co_await http::async_write(stream, serializer, into(error));
        if (error) break;
    }
    beast::error_code ignored;
    stream.socket().shutdown(tcp::socket::shutdown_send, ignored);
}

asio::awaitable<void> accept(tcp::acceptor& acceptor, Server::Handlers handlers) {
    const auto connections = std::make_shared<Connections>();
    asio::steady_timer timer(acceptor.get_executor());
    while (acceptor.is_open()) {
        beast::error_code error;
        tcp::socket socket = co_await acceptor.async_accept(into(error));
        if (error) {
            timer.expires_after(pause);
            co_await timer.async_wait(into(error));
        } else if (connections->make_place()) {
            asio::co_spawn(acceptor.get_executor(),
                           converse(beast::tcp_stream(std::move(socket)), handlers,
                                    std::make_shared<Place>(connections)),
                           asio::detached);
        }
    }
}

}  // namespace

Expected<Server> Server::listen(asio::io_context& context, const std::string& address,
                                std::uint16_t port) {
    beast::error_code error;
    const auto where = asio::ip::make_address(address, error);
    if (error)
        return failure(address, "is not an IP address", "give one, as 127.0.0.1, 0.0.0.0 or ::");
    const tcp::endpoint endpoint(where, port);
    tcp::acceptor acceptor(context);
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(tcp::acceptor::max_listen_connections, error);
    if (error)
        return failure(fmt::format("{} port {}", address, port), error.message(),
                       error == asio::error::address_in_use
                           ? "another program listens there: stop it, or give another --port"
                           : "give an address of this host as --address");
    const tcp::endpoint bound = acceptor.local_endpoint();
    return Server(std::move(acceptor), bound);
}

void Server::start(const Handlers& handlers) {
    asio::co_spawn(acceptor_.get_executor(), accept(acceptor_, handlers), asio::detached);
}

}  // namespace versavis::web
