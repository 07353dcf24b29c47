// SPDX-License-Identifier: BSD-3-Clause
#include "engine/toml/table_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <optional>
#include <sstream>

namespace versavis {

namespace {

/// Largest file that is read: 1 MiB.
constexpr std::size_t largest_file = 1U << 20;

/// Most dots on one line.
constexpr std::ptrdiff_t most_dots = 64;

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

/// One letter of so many may be wrong for a name to be probably meant.
constexpr std::size_t letters_of_a_typo = 2;

/// The one of `names` that was probably meant; none is near: empty. Whoever left out the unit meant
/// the name that begins the same.
std::string nearest(std::string_view meant, const std::vector<std::string>& names) {
    const std::string text = clipped(meant);
    const auto distance = [&](const std::string& name) {
        return name.rfind(text, 0) == 0 ? 0 : edit_distance(text, name);
    };
    const auto closer = [&](const std::string& a, const std::string& b) {
        return distance(a) < distance(b);
    };
    const auto best = std::min_element(names.begin(), names.end(), closer);
    return best == names.end() || distance(*best) > text.size() / letters_of_a_typo ? "" : *best;
}

TomlPlace place(const std::string& path, const toml::source_region& source) {
    return {path, source.begin.line, source.begin.column};
}

/// The value as the file has it.
std::string text_of(const toml::node& node) {
    if (node.is_table()) return "a table";
    if (node.is_array()) return "a list";
    std::ostringstream text;
    text << toml::node_view(node);
    return clipped(text.str());
}

Expected<std::string, TomlProblem> read_file(const std::string& path) {
    const auto refuse = [&](const std::string& what, const char* cure) {
        return Unexpected(TomlProblem{{path}, "", "", what, cure});
    };
    const char* give = "give the path of a readable file";
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    if (!std::filesystem::exists(status)) return refuse("there is no such file", give);
    // Devices and pipes may have no end.
    if (!std::filesystem::is_regular_file(status)) return refuse("is not a regular file", give);
    std::ifstream file(path, std::ios::binary);
    std::string text(largest_file + 1, '\0');
    if (!file) return refuse("cannot be opened", give);
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (file.bad()) return refuse("cannot be read", give);
    text.resize(static_cast<std::size_t>(file.gcount()));
    if (text.size() > largest_file)
        return refuse(fmt::format("is larger than {} bytes", largest_file),
                      "is it the right file?");
    return text;
}

/// The parser calls itself for each level of a key. Comments may hold as many dots as they like.
std::optional<TomlPlace> too_deep(const std::string& path, const std::string& text) {
    std::istringstream lines(text);
    std::uint32_t number = 1;
    for (std::string line; std::getline(lines, line); ++number) {
        const auto comment = line.find('#');
        if (line.find_first_of("\"'") > comment) line.resize(comment);
        if (std::count(line.begin(), line.end(), '.') > most_dots)
            return TomlPlace{path, number, 1};
    }
    return std::nullopt;
}

}  // namespace

Expected<> TomlFile::result() const {
    if (problems.empty()) return {};
    return Unexpected<Error>(problems.front());
}

Expected<toml::table, TomlProblem> parse_toml(const std::string& path) {
    const auto text = read_file(path);
    if (!text) return Unexpected(text.error());
    return parse_toml(*text, path);
}

Expected<toml::table, TomlProblem> parse_toml(const std::string& text, const std::string& path) {
    if (const auto deep = too_deep(path, text))
        return Unexpected(TomlProblem{*deep, "", "",
                                      fmt::format("more than {} dots on one line", most_dots),
                                      "no key is nested so deeply"});
    try {
        return toml::parse(text, path);
    } catch (const toml::parse_error& error) {
        return Unexpected(TomlProblem{place(path, error.source()), "", "",
                                      std::string(error.description()),
                                      "the file must be TOML in UTF-8: https://toml.io"});
    }
}

const toml::node* TableReader::find(std::string_view key) {
    known_.emplace_back(key);
    return table_.get(key);
}

void TableReader::fail(std::string_view key, const std::string& what, const std::string& cure) {
    const toml::node* node = table_.get(key);
    const toml::source_region& source = node != nullptr ? node->source() : table_.source();
    file_.problems.push_back({place(file_.path, source), title_, std::string(key), what,
                              cure.empty() ? "see " + file_.manual : cure});
}

/// The value of the key is not as expected.
void TableReader::refuse(std::string_view key, const std::string& expected,
                         const TomlRange& range) {
    fail(key, fmt::format("'{}' must be {}, but is {}", key, expected, text_of(*table_.get(key))));
    file_.problems.back().range = range;
}

void TableReader::read(std::string_view key, std::string& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    if (const auto text = node->value_exact<std::string>())
        value = *text;
    else
        refuse(key, "a string in quotes");
}

void TableReader::read(std::string_view key, bool& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    if (const auto truth = node->value_exact<bool>())
        value = *truth;
    else
        refuse(key, "true or false");
}

void TableReader::read(std::string_view key, double& value, double minimum, double maximum) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto number = node->is_number() ? node->value<double>() : std::nullopt;
    if (number && *number >= minimum && *number <= maximum)
        value = *number;
    else
        refuse(key, fmt::format("a number from {:.10g} to {}", minimum, quantity(key, maximum)),
               TomlRange{minimum, maximum});
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
        return refuse(key, "a list of strings in quotes: [\"...\", \"...\"]");
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
        refuse(key,
               fmt::format("a whole number from {} to {}{}{}", minimum, maximum,
                           unit_of(key).empty() ? "" : " ", unit_of(key)),
               TomlRange{static_cast<double>(minimum), static_cast<double>(maximum)});
}

std::optional<std::size_t> TableReader::find_choice(std::string_view key,
                                                    const std::vector<std::string>& names) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    const auto text = node->value_exact<std::string>();
    const auto found = text ? std::find(names.begin(), names.end(), *text) : names.end();
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
    refuse(key, fmt::format("one of {}", fmt::join(names, ", ")));
    if (const std::string meant = text ? nearest(*text, names) : ""; !meant.empty())
        file_.problems.back().cure = fmt::format("did you mean \"{}\"?", meant);
    return std::nullopt;
}

const toml::table* TableReader::table(std::string_view key) {
    const toml::node* node = find(key);
    if (node != nullptr && !node->is_table()) refuse(key, fmt::format("a table: [{}]", key));
    return node == nullptr ? nullptr : node->as_table();
}

std::optional<TableReader> TableReader::below(std::string_view key, std::string title) {
    const toml::table* found = table(key);
    if (found == nullptr) return std::nullopt;
    return TableReader(file_, *found, std::move(title));
}

std::vector<const toml::table*> TableReader::tables(std::string_view key) {
    std::vector<const toml::table*> found;
    const toml::node* node = find(key);
    if (node == nullptr) return found;
    const toml::array* array = node->as_array();
    if (array != nullptr && array->empty()) return found;
    if (array == nullptr || !array->is_homogeneous(toml::node_type::table)) {
        refuse(key, fmt::format("an array of tables: [[{}]]", key));
        return found;
    }
    for (const toml::node& entry : *array) found.push_back(entry.as_table());
    return found;
}

bool TableReader::knows(std::string_view key) const {
    return std::find(known_.begin(), known_.end(), key) != known_.end();
}

void TableReader::finish() {
    for (const auto& [key, node] : table_) {
        if (knows(key.str())) continue;
        const std::string meant = nearest(key.str(), known_);
        file_.problems.push_back({place(file_.path, key.source()), title_, std::string(key.str()),
                                  fmt::format("unknown key '{}'", clipped(key.str())),
                                  meant.empty()
                                      ? fmt::format("remove it; the keys are in {}", file_.manual)
                                      : fmt::format("did you mean '{}'?", meant)});
    }
}

TomlEntry TableReader::entry() const {
    TomlEntry entry{title_, place(file_.path, table_.source()), {}};
    for (const auto& [key, node] : table_)
        entry.keys.emplace(key.str(), place(file_.path, node.source()));
    return entry;
}

}  // namespace versavis
