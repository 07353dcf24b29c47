// SPDX-License-Identifier: BSD-3-Clause
#include "list.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "recording/kind_name.hpp"
#include "versavis/stream.hpp"

namespace versavis::client {

namespace {

/// Whatever bytes a name has.
std::string as_text(const nlohmann::json& document) {
    return document.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

Expected<std::string> list_streams(const std::string& instance, bool as_json) {
    StreamOptions options;
    options.instance = instance;
    const auto streams = versavis::list_streams(options);
    if (!streams) return Unexpected(streams.error());
    nlohmann::json document = nlohmann::json::array();
    std::string text;
    for (const StreamInfo& stream : *streams) {
        if (stream.error) {  // it may just have ended, or not be one
            document.push_back({{"name", stream.name}, {"error", stream.error->message()}});
            text += fmt::format("{:<12} {}\n", stream.name, stream.error->message());
            continue;
        }
        document.push_back({{"name", stream.name},
                            {"kind", kind_name(stream.kind)},
                            {"items", stream.published},
                            {"retained", stream.retained},
                            {"alive", stream.alive}});
        text += fmt::format("{:<12} {:<7} {:>10} items, {:>6} retained{}\n", stream.name,
                            kind_name(stream.kind), stream.published, stream.retained,
                            stream.alive ? "" : ", writer gone");
    }
    return as_json ? as_text(document) + "\n" : text;
}

}  // namespace versavis::client
