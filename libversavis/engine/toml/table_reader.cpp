// SPDX-License-Identifier: BSD-3-Clause
#include "engine/toml/table_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

namespace versavis {

namespace {

/// Levenshtein distance: insertions, deletions and substitutions that turn `a` into `b`.
std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), 0);
    for (std::size_t i = 0; i < a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i + 1;
        for (std::size_t j = 0; j < b.size(); ++j) {
            const std::size_t substituted = diagonal + (a[i] == b[j] ? 0 : 1);
            diagonal = row[j + 1];
            row[j + 1] = std::min({row[j] + 1, diagonal + 1, substituted});
        }
    }
    return row.back();
}

std::string place(const std::string& path, const toml::source_region& source) {
    return fmt::format("{}:{}:{}", path, source.begin.line, source.begin.column);
}

}  // namespace

void TomlFile::fail(const toml::node& node, const std::string& what, const std::string& cure) {
    if (result)
        result = failure(place(path, node.source()), what, cure.empty() ? "see " + manual : cure);
}

Expected<toml::table> parse_toml(const std::string& path) {
    try {
        return toml::parse_file(path);
    } catch (const toml::parse_error& error) {
        const bool readable = error.source().begin.line != 0;
        return failure(readable ? place(path, error.source()) : path,
                       std::string(error.description()),
                       readable ? "" : "give the path of a readable file");
    }
}

const toml::node* TableReader::find(std::string_view key) {
    known_.emplace_back(key);
    return table_.get(key);
}

void TableReader::fail(std::string_view key, const std::string& what, const std::string& cure) {
    const toml::node* node = table_.get(key);
    file_.fail(node != nullptr ? *node : static_cast<const toml::node&>(table_), what, cure);
}

void TableReader::read(std::string_view key, std::string& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    if (const auto text = node->value_exact<std::string>())
        value = *text;
    else
        fail(key, fmt::format("'{}' must be a string in quotes", key));
}

void TableReader::read(std::string_view key, bool& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    if (const auto truth = node->value_exact<bool>())
        value = *truth;
    else
        fail(key, fmt::format("'{}' must be true or false", key));
}

void TableReader::read(std::string_view key, double& value, double minimum, double maximum) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto number = node->is_number() ? node->value<double>() : std::nullopt;
    if (number && *number >= minimum && *number <= maximum)
        value = *number;
    else
        fail(key, fmt::format("'{}' must be a number from {} to {}", key, minimum, maximum));
}

void TableReader::read(std::string_view key, std::vector<double>& values, std::size_t count,
                       double minimum, double maximum) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    std::vector<double> read;
    if (const toml::array* array = node->as_array())
        for (const toml::node& entry : *array)
            if (const auto number = entry.is_number() ? entry.value<double>() : std::nullopt;
                number && *number >= minimum && *number <= maximum)
                read.push_back(*number);
    const bool whole = node->is_array() && node->as_array()->size() == count;
    if (!whole || read.size() != count)
        return fail(key, fmt::format("'{}' must be a list of {} numbers from {} to {}", key, count,
                                     minimum, maximum));
    values = std::move(read);
}

void TableReader::read(std::string_view key, std::vector<std::string>& values) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const toml::array* array = node->as_array();
    if (array == nullptr || !(array->empty() || array->is_homogeneous(toml::node_type::string)))
        return fail(
            key, fmt::format("'{}' must be a list of strings in quotes: [\"...\", \"...\"]", key));
    values.clear();
    for (const toml::node& entry : *array) values.push_back(*entry.value_exact<std::string>());
}

void TableReader::read_integer(std::string_view key, std::int64_t& value, std::int64_t minimum,
                               std::int64_t maximum) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto number = node->value_exact<std::int64_t>();
    if (number && *number >= minimum && *number <= maximum)
        value = *number;
    else
        fail(key, fmt::format("'{}' must be a whole number from {} to {}", key, minimum, maximum));
}

std::optional<std::size_t> TableReader::find_choice(std::string_view key,
                                                    const std::vector<std::string>& names) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    const auto text = node->value_exact<std::string>();
    const auto found = text ? std::find(names.begin(), names.end(), *text) : names.end();
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
    fail(key, fmt::format("'{}' must be one of: {}", key, fmt::join(names, ", ")));
    return std::nullopt;
}

const toml::table* TableReader::table(std::string_view key) {
    const toml::node* node = find(key);
    if (node != nullptr && !node->is_table())
        fail(key, fmt::format("'{}' must be a table: [{}]", key, key));
    return node == nullptr ? nullptr : node->as_table();
}

std::vector<const toml::table*> TableReader::tables(std::string_view key) {
    std::vector<const toml::table*> found;
    const toml::node* node = find(key);
    if (node == nullptr) return found;
    const toml::array* array = node->as_array();
    if (array == nullptr || !array->is_homogeneous(toml::node_type::table)) {
        fail(key, fmt::format("'{}' must be an array of tables: [[{}]]", key, key));
        return found;
    }
    for (const toml::node& entry : *array) found.push_back(entry.as_table());
    return found;
}

std::string TableReader::nearest(std::string_view key) const {
    // Whoever left out the unit meant the key that begins the same.
    const auto distance = [key](const std::string& known) {
        return known.rfind(key, 0) == 0 ? 0 : edit_distance(key, known);
    };
    const auto closer = [&](const std::string& a, const std::string& b) {
        return distance(a) < distance(b);
    };
    return *std::min_element(known_.begin(), known_.end(), closer);
}

void TableReader::finish() {
    for (const auto& [key, node] : table_)
        if (std::find(known_.begin(), known_.end(), key.str()) == known_.end())
            file_.result = file_.result
                               ? failure(place(file_.path, key.source()),
                                         fmt::format("unknown key '{}'", key.str()),
                                         fmt::format("did you mean '{}'?", nearest(key.str())))
                               : file_.result;
}

}  // namespace versavis
