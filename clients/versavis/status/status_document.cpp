// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_document.hpp"

#include <fmt/format.h>

namespace versavis::client {

namespace {

/// The service's heart beats every 50 ms. A process that cannot be found, but whose heart beats, is
/// of another container. At half, one that was just held up is called dead; at twice, a dead one
/// is named a quarter of a second later.
constexpr Duration heart_stopped = milliseconds(250);

bool has_died(const ring::Reader& reader) {
    return !reader.writer_found() && host_now() - reader.last_heartbeat() > heart_stopped;
}

}  // namespace

Expected<nlohmann::json> read_status(const std::string& instance) {
    auto stream = StatusStream::open("status", instance, ring::Reader::From::oldest);
    if (!stream) return Unexpected(stream.error());
    std::optional<std::string> newest;
    for (auto item = stream->wait(seconds(1));
         item.found == Found::item || item.found == Found::lost;
         item = newest ? stream->next() : stream->wait(seconds(1))) {
        std::string text(item.payload_size, '\0');
        if (item.found == Found::item &&
            stream->copy(item, reinterpret_cast<std::byte*>(text.data())))
            newest = std::move(text);
    }
    if (!stream->reader().writer_alive() || has_died(stream->reader()))
        return failure(fmt::format("instance {}", instance), "the service has died or is hanging",
                       "see its log ('journalctl -u versavisd'), then restart it");
    if (!newest)
        return failure(fmt::format("instance {}", instance),
                       "the service has not published its status yet", "try again in a second");
    auto document = nlohmann::json::parse(*newest, nullptr, false);
    if (document.is_discarded() || document.value("schema", 0) != 1)
        return failure(fmt::format("instance {}", instance),
                       "the status document has another version",
                       "install service and clients of the same release");
    return document;
}

Error explain(const Error& error, const std::string& instance, const std::string& stream) {
    const auto status = read_status(instance);
    if (!status) return error;
    for (const char* kind : {"cameras", "imus"})
        for (const auto& device : status->value(kind, nlohmann::json::array()))
            if (device.value("name", "") == stream && !device.value("fault", std::string()).empty())
                return {stream,
                        fmt::format("the device is {}, so there is nothing to read",
                                    device.value("state", "not well")),
                        device.value("hint", "see 'versavis status'")};
    return error;
}

}  // namespace versavis::client
