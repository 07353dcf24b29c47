// SPDX-License-Identifier: BSD-3-Clause
// What is wrong in a TOML file, where, and what to do about it; and where its tables and keys are.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "versavis/error.hpp"

namespace versavis {

struct TomlPlace {
    std::string path;
    std::uint32_t line = 0;  ///< from 1; 0: the file as a whole
    std::uint32_t column = 0;

    /// "file:line:column".
    std::string text() const;
};

/// What a key may be, in the unit of its name, as far as it is limited.
struct TomlRange {
    std::optional<double> minimum;
    std::optional<double> maximum;
};

struct TomlProblem {
    TomlPlace place;
    std::string table;  ///< such as `[[camera]] "cam0"`; empty: the top of the file
    std::string key;    ///< empty: the table as a whole
    std::string what;
    std::string cure;
    TomlRange range{};

    /// "file:line:column: what; cure" on one line, without control characters.
    std::string message() const;
    operator Error() const { return {place.text(), what, cure}; }
};

using TomlProblems = std::vector<TomlProblem>;

/// Where a table and its keys are, for what is found out after it was read.
struct TomlEntry {
    std::string title;  ///< such as `[[camera]] "cam0"`
    TomlPlace place;
    std::map<std::string, TomlPlace> keys;  ///< those that are there

    bool has(const std::string& key) const { return keys.count(key) != 0; }
    /// Of the key; of the table if the key is not there.
    const TomlPlace& place_of(const std::string& key) const;
    /// "file:line:column: 'key' of [[table]]"; the key alone when the file has no such table.
    std::string reference(const std::string& key) const;
    TomlProblem problem(const std::string& key, std::string what, std::string cure) const;

    /// Values are the same wherever they are in a file.
    friend bool operator==(const TomlEntry& /*a*/, const TomlEntry& /*b*/) { return true; }
};

/// The unit that ends the name of a key: "us" of "pulse_us"; empty: none.
std::string_view unit_of(std::string_view key);

/// A number with the unit of the key.
std::string quantity(std::string_view key, double value);

/// Text of a user, cut where it is too long for a message.
std::string clipped(std::string_view text);

}  // namespace versavis
