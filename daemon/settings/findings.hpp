// SPDX-License-Identifier: BSD-3-Clause
// What rules find wrong in a configuration, and what they share.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "engine/toml/problem.hpp"

namespace versavis::daemon {

class Findings {
 public:
    explicit Findings(TomlProblems& problems) : problems_(problems) {}

    void add(const TomlEntry& entry, const std::string& key, const std::string& what,
             const std::string& cure, const TomlRange& range = {}) {
        TomlProblem found = entry.problem(key, what, cure);
        found.range = range;
        const auto same_place = [&](const TomlProblem& known) {
            return known.place.path == found.place.path && known.place.line == found.place.line &&
                   known.place.column == found.place.column && known.key == found.key;
        };
        if (std::none_of(problems_.begin(), problems_.end(), same_place))
            problems_.push_back(std::move(found));
    }

    /// Refuses a value above what another key leaves.
    void limit(const TomlEntry& entry, const std::string& key, double value, double maximum,
               const std::string& reason, const std::string& cure) {
        if (value > maximum)
            add(entry, key,
                fmt::format("'{}' is {}, but must be at most {} ({})", key, quantity(key, value),
                            quantity(key, maximum), reason),
                cure, TomlRange{std::nullopt, maximum});
    }

 private:
    TomlProblems& problems_;
};

inline bool contains(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

/// The entry in words, with its line, and with its file if a message about `seen_from` has another.
inline std::string at_line(const TomlEntry& entry, const TomlEntry& seen_from) {
    const std::string line = fmt::format("{} on line {}", entry.title, entry.place.line);
    return entry.place.path == seen_from.place.path ? line : line + " of " + entry.place.path;
}

/// Reports each that agrees with one before it, with the first of them.
template <class Entry, class Same, class Report>
void find_repeated(const std::vector<Entry>& entries, Same same, Report report) {
    for (auto second = entries.begin(); second != entries.end(); ++second) {
        const auto first =
            std::find_if(entries.begin(), second, [&](const Entry& e) { return same(e, *second); });
        if (first != second) report(*first, *second);
    }
}

}  // namespace versavis::daemon
