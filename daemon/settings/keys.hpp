// SPDX-License-Identifier: BSD-3-Clause
// The keys of the configuration file: one row each, from which they are read, documented, listed by
// `versavisd --keys`, and named when the board refuses their values.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "configuration.hpp"
#include "engine/toml/table_reader.hpp"

namespace versavis::daemon {

/// Reads the keys of one table into its part of the configuration. What follows from other keys,
/// and tables below this one, are left to the caller.
template <class Part>
void read_keys(TableReader& reader, Part& part);

/// A key as docs/user/configuration.md has it, in Markdown.
struct KeyDescription {
    std::string table;  ///< such as "[[camera]]"; empty: the top of the file
    std::string key;
    std::string default_value;  ///< empty: there is none
    std::string range;
    std::string meaning;
};

/// All keys, in the order of the document.
std::vector<KeyDescription> describe_keys();

/// The key whose value the board has in this field, and how many of the board's units are one of
/// the key's; 0: the value is one of several names.
struct BoardKey {
    std::string key;
    double board_units = 0;
};
std::optional<BoardKey> find_key(wire::ConfigurationField field);

/// Slots for frames that wait for proof, and for the newest ones that readers still want.
constexpr unsigned spare_slots = 8;

}  // namespace versavis::daemon
