// SPDX-License-Identifier: BSD-3-Clause
#include "key_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace versavis::daemon {

using nlohmann::json;

namespace {

std::string without_markdown(std::string text) {
    text.erase(std::remove(text.begin(), text.end(), '`'), text.end());
    return text;
}

}  // namespace

std::string to_text(const std::vector<KeyDescription>& keys) {
    std::string text;
    std::string table;
    for (const KeyDescription& key : keys) {
        if (key.table != table) text += fmt::format("\n{}\n", table = key.table);
        text += fmt::format("{:<19} {}\n{:<20}{}{}\n", key.key, key.meaning, "", key.range,
                            key.default_value.empty() ? "" : "; default: " + key.default_value);
    }
    return without_markdown(text);
}

std::string to_json(const std::vector<KeyDescription>& keys) {
    json list = json::array();
    for (const auto& [table, key, default_value, range, meaning] : keys)
        list.push_back({{"table", table},
                        {"key", key},
                        {"default", without_markdown(default_value)},
                        {"range", without_markdown(range)},
                        {"meaning", without_markdown(meaning)}});
    return list.dump(2);
}

}  // namespace versavis::daemon
