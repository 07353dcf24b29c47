// SPDX-License-Identifier: BSD-3-Clause
// JSON that anybody may have written, into a ring or a recording.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

namespace versavis::client {

/// Documents of the service have some five levels.
inline constexpr int deepest_json = 64;

/// Discarded (is_discarded()): it is damaged, or nested more deeply.
inline nlohmann::json parse_shallow_json(std::string_view text) {
    using nlohmann::json;
    bool too_deep = false;
    const auto look = [&](int depth, json::parse_event_t /*event*/, json& /*value*/) {
        too_deep = too_deep || depth > deepest_json;
        return !too_deep;  // what is below is not kept
    };
    json document = json::parse(text.begin(), text.end(), look, false);
    return too_deep ? json(json::value_t::discarded) : document;
}

}  // namespace versavis::client
