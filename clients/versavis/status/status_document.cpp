// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_document.hpp"

#include <fmt/format.h>

namespace versavis::client {

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
    if (!stream->reader().writer_alive())
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

}  // namespace versavis::client
