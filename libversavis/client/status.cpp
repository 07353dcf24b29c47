// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/status.hpp"

#include <optional>

namespace versavis {

Expected<std::string> read_status(const StreamOptions& options) {
    auto stream = StatusStream::open("status", options);
    if (!stream) return Unexpected(stream.error());
    std::optional<std::string> newest;
    for (int attempts = 0; attempts < 3 && !newest; ++attempts) {
        const auto item = stream->latest(seconds(1));
        if (!item) continue;
        std::string text(item->payload.size(), '\0');
        if (item->payload.copy_to(reinterpret_cast<std::byte*>(text.data())))
            newest = std::move(text);
    }
    const std::string where = "instance " + options.instance;
    if (!stream->reader().writer_alive())
        return failure(where, "the service has died or hangs",
                       "see its log ('journalctl -u versavisd'), then restart it");
    if (!newest)
        return failure(where, "the service has not published its status yet",
                       "try again in a second");
    return std::move(*newest);
}

}  // namespace versavis
