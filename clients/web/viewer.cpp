// SPDX-License-Identifier: BSD-3-Clause
#include "viewer.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <memory>

#include "coroutine.hpp"
#include "foxglove.hpp"
#include "routes.hpp"

namespace versavis::web {

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;

/// How often streams are looked at: half of what a viewer of 25 Hz would notice.
constexpr std::chrono::milliseconds turn{20};
/// A viewer that has not read for so long, or is gone without a word, is let go.
constexpr std::chrono::seconds patience{30};
constexpr std::size_t most_message_bytes = 65536;
/// What is in the kernel cannot be passed over any more: less than a frame is, of most cameras.
constexpr int send_buffer_bytes = 512 * 1024;

struct Connection {
    Connection(beast::tcp_stream stream, const std::string& instance, LiveData& data)
        : socket(std::move(stream)), session(instance, data) {}

    websocket::stream<beast::tcp_stream> socket;
    FoxgloveSession session;
    bool open = true;
};

asio::awaitable<void> receive(std::shared_ptr<Connection> connection) {
    beast::flat_buffer buffer;
    while (connection->open) {
        beast::error_code error;
        co_await connection->socket.async_read(buffer, into(error));
        if (error) break;
        if (connection->socket.got_text())
            connection->session.receive(
                {static_cast<const char*>(buffer.data().data()), buffer.size()});
        buffer.clear();
    }
    connection->open = false;
}

/// As fast as the viewer takes it: what comes while it does not is passed over.
asio::awaitable<void> send(std::shared_ptr<Connection> connection) {
    auto& socket = connection->socket;
    asio::steady_timer timer(socket.get_executor());
    while (connection->open) {
        beast::error_code error;
        const HostTime now = host_now();
        auto message = connection->session.next_text(now);
        socket.text(message.has_value());
        if (!message) message = connection->session.next_message(now);
        if (message) {
            co_await socket.async_write(asio::buffer(*message), into(error));
        } else {
            timer.expires_after(turn);
            co_await timer.async_wait(into(error));
        }
        if (error) connection->open = false;
    }
    beast::get_lowest_layer(socket).close();
}

asio::awaitable<void> serve(beast::tcp_stream stream, Request request, const Settings& settings,
                            LiveData& data, [[maybe_unused]] std::shared_ptr<void> place) {
    beast::error_code error;
    if (const auto refused = refuse_viewer(request, settings)) {
        stream.expires_after(patience);
        co_await http::async_write(stream, *refused, into(error));
        co_return;
    }
    stream.expires_never();
    stream.socket().set_option(asio::socket_base::send_buffer_size(send_buffer_bytes), error);
    const auto connection =
        std::make_shared<Connection>(std::move(stream), settings.instance, data);
    auto& socket = connection->socket;
    socket.set_option(websocket::stream_base::timeout{patience, patience, true});
    socket.read_message_max(most_message_bytes);
    const std::string protocol(
        foxglove_protocol(as_view(request[http::field::sec_websocket_protocol])));
    socket.set_option(websocket::stream_base::decorator([&](websocket::response_type& response) {
        response.set(http::field::sec_websocket_protocol, protocol);
    }));
    co_await socket.async_accept(request, into(error));
    if (error) co_return;
    asio::co_spawn(socket.get_executor(), receive(connection), asio::detached);
    co_await send(connection);
}

}  // namespace

void serve_viewer(beast::tcp_stream stream, Request request, const Settings& settings,
                  LiveData& data, std::shared_ptr<void> place) {
    const auto executor = stream.get_executor();
    asio::co_spawn(executor,
                   serve(std::move(stream), std::move(request), settings, data, std::move(place)),
                   asio::detached);
}

}  // namespace versavis::web
