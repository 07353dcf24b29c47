// SPDX-License-Identifier: BSD-3-Clause
// Reads the keys of TOML tables with types, ranges and choices; problems are collected, and name
// line, column and the nearest keys.
#pragma once

#include <toml++/toml.h>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/toml/problem.hpp"
#include "versavis/error.hpp"

namespace versavis {

/// The file that is being read, and all that is wrong in it.
struct TomlFile {
    std::string path;    ///< of values that know of no other
    std::string manual;  ///< where the keys are documented
    TomlProblems problems{};
    /// What to do about a key that the table of this title does not have, if it is known; else "".
    std::function<std::string(std::string_view title, std::string_view key)> cure_of_stray{};

    /// The first of its problems, for who needs no more.
    Expected<> result() const;
};

/// Parses `path`. Errors: it is no regular file, too large, too deep, or not valid TOML.
Expected<toml::table, TomlProblem> parse_toml(const std::string& path);

/// The same of a text that was read before; `path` is what problems call it.
Expected<toml::table, TomlProblem> parse_toml(const std::string& text, const std::string& path);

/// A key that is absent leaves its value as it is. finish() refuses keys that nobody asked for.
class TableReader {
 public:
    /// `title` is what messages call the table, such as `[[camera]] "cam0"`.
    TableReader(TomlFile& file, const toml::table& table, std::string title = {})
        : file_(file), table_(table), title_(std::move(title)) {}

    void read(std::string_view key, std::string& value);
    void read(std::string_view key, bool& value);
    void read(std::string_view key, std::vector<std::string>& values);

    /// So many numbers, each in the range.
    void read(std::string_view key, std::vector<double>& values, std::size_t count, double minimum,
              double maximum);

    /// Accepts whole numbers as well.
    void read(std::string_view key, double& value, double minimum, double maximum);

    template <class Integer>
    void read(std::string_view key, Integer& value, std::int64_t minimum, std::int64_t maximum) {
        std::int64_t wide = static_cast<std::int64_t>(value);
        read_integer(key, wide, minimum, maximum);
        value = static_cast<Integer>(wide);
    }

    /// Without the key there is no value.
    template <class Type, class... Range>
    void read(std::string_view key, std::optional<Type>& value, Range... range) {
        if (find(key) != nullptr) read(key, value.emplace(), range...);
    }

    /// One of the names given. `difference`: a sentence on names that are easily confused, for who
    /// may have meant several.
    template <class Enum>
    void choose(std::string_view key, Enum& value,
                const std::vector<std::pair<std::string, Enum>>& choices,
                std::string_view difference = {}) {
        std::vector<std::string> names;
        for (const auto& choice : choices) names.push_back(choice.first);
        if (const auto chosen = find_choice(key, names, difference))
            value = choices[*chosen].second;
    }

    /// The table below `key`, if there is one.
    const toml::table* table(std::string_view key);

    /// The reader of that table, which messages call `title`.
    std::optional<TableReader> below(std::string_view key, std::string title = {});

    /// The tables of the array below `key`.
    std::vector<const toml::table*> tables(std::string_view key);

    bool has(std::string_view key) const { return table_.contains(key); }

    /// All that is in the table, for keys that nobody knows beforehand.
    const toml::table& contents() const { return table_; }

    /// True for a key that was asked for.
    bool knows(std::string_view key) const;
    void fail(std::string_view key, const std::string& what, const std::string& cure = {});
    void finish();

    /// Where the table and its keys are.
    TomlEntry entry() const;

 private:
    const toml::node* find(std::string_view key);
    void refuse(std::string_view key, const std::string& expected, const TomlRange& range = {});
    void read_integer(std::string_view key, std::int64_t& value, std::int64_t minimum,
                      std::int64_t maximum);
    std::optional<std::size_t> find_choice(std::string_view key,
                                           const std::vector<std::string>& names,
                                           std::string_view difference);

    TomlFile& file_;
    const toml::table& table_;
    std::string title_;
    std::vector<std::string> known_;
};

}  // namespace versavis
