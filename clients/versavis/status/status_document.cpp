// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_document.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <map>
#include <sstream>

#include "base/json_text.hpp"
#include "base/shallow_json.hpp"
#include "posix/child_process.hpp"
#include "versavis/status.hpp"

namespace versavis::client {

Expected<nlohmann::json> read_status(const std::string& instance) {
    StreamOptions options;
    options.instance = instance;
    const auto newest = versavis::read_status(options);
    if (!newest) return Unexpected(newest.error());
    auto document = parse_shallow_json(*newest);
    if (!document.is_object() || document.value("schema", nlohmann::json()) != 1)
        return failure(fmt::format("instance {}", instance),
                       "the status document has another version",
                       "install service and clients of the same release");
    return document;
}

std::optional<Error> why_silent(const std::string& units) {
    std::istringstream lines(units);
    std::map<std::string, std::string> unit;
    std::optional<Error> failed;
    for (std::string line; std::getline(lines, line);) {
        const std::size_t equals = line.find('=');
        if (equals == std::string::npos) {  // an empty one: the next unit
            unit.clear();
            continue;
        }
        unit[line.substr(0, equals)] = line.substr(equals + 1);
        if (unit.size() < 3) continue;
        const std::string& id = unit["Id"];
        const std::string& status = unit["StatusText"];
        const std::string log = fmt::format("see 'journalctl -u {}'", id);
        if (unit["ActiveState"] == "active" && status.rfind("waiting: ", 0) == 0)
            return Error{id, status, log};
        if (unit["ActiveState"] == "failed") failed = {id, "it has failed", log};
    }
    return failed;
}

std::optional<Error> why_silent() {
    auto systemctl =
        ChildProcess::start({"systemctl", "show", "--property=Id,ActiveState,StatusText",
                             "versavisd.service", "versavisd@*.service"},
                            ChildProcess::Errors::dropped);
    if (!systemctl) return std::nullopt;
    std::string text;
    std::array<char, 4096> piece{};
    for (ssize_t size = 0; (size = ::read(systemctl->socket(), piece.data(), piece.size())) > 0;)
        text.append(piece.data(), static_cast<std::size_t>(size));
    systemctl->wait();
    return why_silent(text);
}

Error explain_silence(Error error) {
    if (const auto why = why_silent()) error.cure += "; " + why->message();
    return error;
}

std::string configuration_path(const std::string& named,
                               const std::optional<nlohmann::json>& status) {
    if (!named.empty()) return named;
    const std::string read = status ? status->value("configuration", "") : "";
    return read.empty() ? VERSAVIS_SYSCONFDIR "/versavis/versavis.toml" : read;
}

std::string preset_of(const nlohmann::json& status, const std::string& name) {
    for (const auto& camera : status.value("cameras", nlohmann::json::array()))
        if (text(camera, "name") == name) return text(camera, "preset");
    return "";
}

Error explain(const Error& error, const std::string& instance, const std::string& stream) {
    const auto status = read_status(instance);
    if (!status) return error;
    for (const char* kind : device_arrays)
        for (const auto& device : status->value(kind, nlohmann::json::array()))
            if (device.value("name", "") == stream && !device.value("fault", std::string()).empty())
                return {stream,
                        fmt::format("the device is {}, so there is nothing to read",
                                    device.value("state", "not well")),
                        device.value("hint", "see 'versavis status'")};
    return error;
}

}  // namespace versavis::client
