// SPDX-License-Identifier: BSD-3-Clause
#include "configuration_document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <sstream>
#include <string_view>

#include "configuration_file.hpp"
#include "engine/toml/service_file.hpp"
#include "engine/toml/table_reader.hpp"
#include "keys.hpp"

namespace versavis::daemon {

namespace {

constexpr const char* features = "features";

/// Arrays of tables, each of which has a name of its own.
constexpr std::string_view named_tables[]{"camera", "imu", "time_output"};

/// Tables that only the board needs, which is configured anew.
constexpr std::string_view live_tables[]{"illumination", "ports"};

/// Keys of a camera that its ring, its thread and its place at the board are made by.
constexpr std::string_view fixed_camera_keys[]{"name",         "device", "trigger", "output",
                                               "strobe_input", "master", "buffers", "slots",
                                               "history_s",    "history"};

template <std::size_t Count>
bool among(const std::string_view (&names)[Count], std::string_view name) {
    return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

std::string text_of(const toml::node* node) {
    if (node == nullptr) return "";
    std::ostringstream text;
    text << toml::node_view(*node);
    return text.str();
}

std::set<std::string> keys_of(const toml::table& before, const toml::table& after) {
    std::set<std::string> keys;
    for (const toml::table* table : {&before, &after})
        for (const auto& [key, node] : *table) keys.emplace(key.str());
    return keys;
}

std::string name_of(const toml::table& table, std::string_view kind) {
    // The only one of these may do without.
    std::string usual;
    if (kind == "imu") usual = ImuConfiguration().name;
    if (kind == "time_output") usual = TimeOutputConfiguration().name;
    return table["name"].value_or(usual);
}

/// The tables of an array by their names.
template <class Root>
auto named(Root& root, std::string_view kind) {
    std::vector<std::pair<std::string, decltype(root[kind].as_table())>> tables;
    if (auto* array = root[kind].as_array())
        for (auto& node : *array)
            if (auto* table = node.as_table()) tables.emplace_back(name_of(*table, kind), table);
    return tables;
}

template <class Root>
auto* find_named(Root& root, std::string_view kind, const std::string& name) {
    for (const auto& [own, table] : named(root, kind))
        if (own == name) return table;
    return decltype(root[kind].as_table()){};
}

void compare(const toml::table& before, const toml::table& after, const std::string& table,
             const std::string& name, std::vector<KeyChange>& found) {
    for (const std::string& key : keys_of(before, after))
        if (text_of(before.get(key)) != text_of(after.get(key)))
            found.push_back({table, name, key});
}

void compare_named(const toml::table& before, const toml::table& after, const std::string& kind,
                   std::vector<KeyChange>& found) {
    for (const auto& [name, table] : named(before, kind)) {
        const toml::table* other = find_named(after, kind, name);
        if (other == nullptr)
            found.push_back({kind, name, ""});
        else
            compare(*table, *other, kind, name, found);
    }
    for (const auto& [name, table] : named(after, kind))
        if (find_named(before, kind, name) == nullptr) found.push_back({kind, name, ""});
}

bool is_camera_key(const std::string& key) {
    const auto all = describe_keys();
    return std::any_of(all.begin(), all.end(), [&](const KeyDescription& known) {
        return known.table == "[[camera]]" && known.key == key;
    });
}

void put(toml::table& table, const std::string& key, const toml::node* value) {
    if (value == nullptr)
        table.erase(key);
    else
        value->visit([&](const auto& node) { table.insert_or_assign(key, node); });
}

/// The table that a change is in; null: it is not there.
template <class Root>
auto* find_table(Root& root, const KeyChange& change) {
    if (change.table.empty()) return &root;
    if (!change.name.empty()) return find_named(root, change.table, change.name);
    return root[change.table].as_table();
}

}  // namespace

std::string KeyChange::text() const {
    std::string text = table;
    for (const std::string* part : {&name, &key})
        if (!part->empty()) text += (text.empty() ? "" : ".") + *part;
    return text;
}

bool KeyChange::live() const {
    if (table.empty()) return key == "log_level";
    if (table == "camera") return !key.empty() && !among(fixed_camera_keys, key);
    return among(live_tables, table);
}

std::vector<KeyChange> changes(const toml::table& before, const toml::table& after) {
    std::vector<KeyChange> found;
    static const toml::table none;
    for (const std::string& key : keys_of(before, after)) {
        const toml::node* old_node = before.get(key);
        const toml::node* new_node = after.get(key);
        const bool table = (old_node != nullptr && old_node->is_table()) ||
                           (new_node != nullptr && new_node->is_table());
        if (among(named_tables, key)) {
            compare_named(before, after, key, found);
        } else if (table) {
            const toml::table* old_table = before[key].as_table();
            const toml::table* new_table = after[key].as_table();
            compare(old_table != nullptr ? *old_table : none,
                    new_table != nullptr ? *new_table : none, key, "", found);
        } else if (text_of(old_node) != text_of(new_node)) {
            found.push_back({"", "", key});
        }
    }
    return found;
}

Expected<ConfigurationDocument, TomlProblems> ConfigurationDocument::load(const std::string& path) {
    auto root = parse_service_file(path);
    if (!root) return Unexpected(std::move(root.error()));
    auto configuration = read_configuration(*root, path);
    if (!configuration) return Unexpected(std::move(configuration.error()));
    return ConfigurationDocument{std::move(*root), std::move(*configuration)};
}

Expected<ConfigurationDocument, TomlProblems> ConfigurationDocument::made_of(
    toml::table root_made) const {
    auto read = read_configuration(root_made, configuration.entry.place.path);
    if (!read) return Unexpected(std::move(read.error()));
    return ConfigurationDocument{std::move(root_made), std::move(*read)};
}

Expected<ConfigurationDocument, TomlProblems> ConfigurationDocument::with_live_keys_of(
    const toml::table& next) const {
    toml::table made = root;
    for (const KeyChange& change : changes(root, next)) {
        if (!change.live()) continue;
        const toml::table* from = find_table(next, change);
        toml::table* to = find_table(made, change);
        if (to == nullptr) to = made.insert(change.table, toml::table{}).first->second.as_table();
        put(*to, change.key, from == nullptr ? nullptr : from->get(change.key));
    }
    return made_of(std::move(made));
}

Expected<ConfigurationDocument, TomlProblems> ConfigurationDocument::with(
    const std::string& camera, const NewValues& values) const {
    toml::table made = root;
    toml::table& table = *find_named(made, "camera", camera);
    for (const auto& [key, text] : values) {
        toml::table* to = &table;
        std::string last = key;
        constexpr std::string_view control = "auto_exposure.";
        if (key.rfind(control, 0) == 0) {
            to = table.insert("auto_exposure", toml::table{}).first->second.as_table();
            last = key.substr(control.size());
        } else if (!is_camera_key(key)) {
            to = table.insert(features, toml::table{}).first->second.as_table();
        }
        if (text.empty()) {
            put(*to, last, nullptr);
            continue;
        }
        const auto parsed = parse_toml("value = " + text, key);
        if (!parsed) return Unexpected(TomlProblems{parsed.error()});
        put(*to, last, parsed->get("value"));
    }
    return made_of(std::move(made));
}

}  // namespace versavis::daemon
