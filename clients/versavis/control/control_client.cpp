// SPDX-License-Identifier: BSD-3-Clause
#include "control/control_client.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "versavis/ring_path.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// The service itself gives a camera ten seconds.
constexpr timeval patience{15, 0};

Unexpected<> not_connected(const std::string& path) {
    if (errno == ENOENT || errno == ECONNREFUSED)
        return failure(path, "the service is not running", "start it, or choose its --instance");
    if (errno == EACCES)
        return failure(path, "you may not control the service",
                       "use sudo, or add yourself to the groups versavis and versavis-admin");
    return failure(path, std::strerror(errno));
}

std::vector<std::string> list(const json& parameters, const char* name) {
    return parameters.value(name, std::vector<std::string>());
}

/// What the error means, and what to do.
Error explain(const std::string& error, const json& parameters) {
    const std::string camera = parameters.value("camera", "");
    if (error == "org.versavis.service.UnknownCamera")
        return {camera, "there is no such camera",
                fmt::format("the service has {}", fmt::join(list(parameters, "cameras"), ", "))};
    if (error == "org.versavis.service.Refused")
        return {"", fmt::format("{}", fmt::join(list(parameters, "problems"), "\n")), ""};
    if (error == "org.versavis.service.NeedsRestart")
        return {"",
                fmt::format("{} cannot change while the service runs",
                            fmt::join(list(parameters, "keys"), ", ")),
                "set it in the configuration file, and restart the service"};
    if (error == "org.versavis.service.NoAnswer")
        return {camera, "it has not done so yet, and may do it later", "see 'versavis status'"};
    return {"", fmt::format("{} {}", error, parameters.dump()),
            "are tool and service of one release?"};
}

}  // namespace

Expected<ControlClient> ControlClient::connect(const std::string& instance) {
    const std::string path = control_path(instance);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path)
        return failure(path, "is too long for a socket", "choose a shorter instance");
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (!socket ||
        ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
        return not_connected(path);
    ::setsockopt(socket.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    return ControlClient(path, std::move(socket));
}

Expected<json> ControlClient::call(const std::string& method, const json& parameters) {
    const std::string message =
        json{{"method", "org.versavis.service." + method}, {"parameters", parameters}}.dump(
            -1, ' ', false, json::error_handler_t::replace) +
        '\0';
    const ssize_t sent = ::send(socket_.get(), message.data(), message.size(), MSG_NOSIGNAL);
    if (sent != static_cast<ssize_t>(message.size()))
        return failure(path_, "the service does not take the call", "is it still running?");
    const auto answer = receive();
    if (!answer) return Unexpected(answer.error());
    const json reply = json::parse(*answer, nullptr, false);
    if (!reply.is_object()) return failure(path_, "the answer is no JSON object");
    const json result = reply.value("parameters", json::object());
    if (reply.contains("error")) return Unexpected(explain(reply.value("error", ""), result));
    return result;
}

Expected<std::string> ControlClient::receive() {
    std::string answer;
    std::array<char, 4096> bytes{};
    while (answer.find('\0') == std::string::npos) {
        const ssize_t count = ::recv(socket_.get(), bytes.data(), bytes.size(), 0);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0)
            return failure(path_, "the service does not answer",
                           "see 'versavis status' and its log");
        answer.append(bytes.data(), static_cast<std::size_t>(count));
    }
    answer.resize(answer.find('\0'));
    return answer;
}

}  // namespace versavis::client
