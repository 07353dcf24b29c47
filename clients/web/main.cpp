// SPDX-License-Identifier: BSD-3-Clause
// versavis-web: what the service publishes, in a browser.
#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>

#include "base/fail.hpp"
#include "live_data.hpp"
#include "routes.hpp"
#include "server.hpp"
#include "versavis/ring_path.hpp"
#include "viewer.hpp"

namespace {

using namespace versavis;
using namespace versavis::web;

constexpr std::chrono::milliseconds turn{100};
/// 16 characters of 64 are 96 bits, which nobody guesses.
constexpr std::size_t shortest_token = 16;

/// Errors: cannot be read, too short, or has characters that a cookie cannot.
Expected<std::string> read_token(const std::string& path) {
    std::ifstream file(path);
    std::string token;
    if (!(file >> token))
        return failure(path, "cannot be read, or is empty", "make one: openssl rand -hex 16");
    const bool plain = token.find_first_not_of(
                           "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
                           "0123456789-_.") == std::string::npos;
    if (token.size() < shortest_token || !plain)
        return failure(path, "is no token: 16 or more letters, digits, '-', '_' and '.'",
                       "make one: openssl rand -hex 16");
    return token;
}

void turn_by_turn(boost::asio::steady_timer& timer, LiveData& data) {
    timer.expires_after(turn);
    timer.async_wait([&](const boost::system::error_code& error) {
        if (error) return;
        data.advance(host_now());
        turn_by_turn(timer, data);
    });
}

int serve(const Settings& settings, client::Lenses lenses) {
    boost::asio::io_context context(1);
    auto server = Server::listen(context, settings.address, settings.port);
    if (!server) return client::fail(server.error());
    if (settings.token.empty() && !server->endpoint().address().is_loopback())
        return client::fail({settings.address, "others could look, too",
                             "give --token-file FILE, or only 127.0.0.1"},
                            EX_USAGE);
    LiveData data(settings.instance, std::move(lenses));
    RecordingProcess recording(settings.instance, settings.record_to);
    server->start(
        {[&](const Request& request) { return respond(request, settings, data, recording); },
         [&](boost::beast::tcp_stream stream, Request request, std::shared_ptr<void> place) {
             serve_viewer(std::move(stream), std::move(request), settings, data, std::move(place));
         }});
    boost::asio::steady_timer timer(context);
    turn_by_turn(timer, data);
    boost::asio::signal_set signals(context, SIGINT, SIGTERM);
    signals.async_wait([&](const boost::system::error_code&, int) { context.stop(); });
    const auto endpoint = server->endpoint();
    const bool six = endpoint.address().is_v6();
    fmt::print("http://{}{}{}:{}/{}\n", six ? "[" : "", endpoint.address().to_string(),
               six ? "]" : "", endpoint.port(), settings.token.empty() ? "" : "?token=TOKEN");
    std::fflush(stdout);
    context.run();
    return EX_OK;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Shows what the service publishes in a browser: pictures, stamps, states."};
    app.set_version_flag("--version", "versavis-web " VERSAVIS_VERSION);
    Settings settings;
    settings.instance = default_instance();
    std::string token_file;
    std::vector<std::string> calibrations;
    app.add_option("--instance", settings.instance, "Of the service")->capture_default_str();
    app.add_option("--address", settings.address, "To listen on; others than loopback need a token")
        ->capture_default_str();
    app.add_option("--port", settings.port, "To listen on; 0: any that is free")
        ->capture_default_str();
    app.add_option("--record-to", settings.record_to,
                   "Folder of recordings that are begun from the page; none: it has no button")
        ->check(CLI::ExistingDirectory);
    app.add_option("--allow-origin", settings.origins,
                   "Whose pages may open WebSockets, as https://app.foxglove.dev");
    app.add_option("--calibration", calibrations,
                   "Kalibr's camchain.yaml, for the camera infos of Foxglove; may be repeated")
        ->allow_extra_args(false);
    app.add_option("--token-file", token_file, "Whoever looks needs the token in this file");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    if (!token_file.empty()) {
        auto token = read_token(token_file);
        if (!token) return client::fail(token.error(), EX_NOINPUT);
        settings.token = std::move(*token);
    }
    auto lenses = client::read_lenses(calibrations);
    if (!lenses) return client::fail(lenses.error(), EX_NOINPUT);
    for (const std::string& why : lenses->left_out) fmt::print(stderr, "{}\n", why);
    return serve(settings, std::move(*lenses));
}
