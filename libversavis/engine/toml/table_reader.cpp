// SPDX-License-Identifier: BSD-3-Clause
#include "engine/toml/table_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <optional>
#include <sstream>
#include <system_error>

namespace versavis {

namespace {

/// Largest file that is read: 1 MiB.
constexpr std::size_t largest_file = 1U << 20;

/// Most dots on one line.
constexpr std::ptrdiff_t most_dots = 64;

/// Insertions, deletions, substitutions and swaps of neighbours that turn `a` into `b`.
std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::vector<std::size_t>> cost(a.size() + 1,
                                               std::vector<std::size_t>(b.size() + 1));
    std::iota(cost[0].begin(), cost[0].end(), 0);
    for (std::size_t i = 1; i <= a.size(); ++i) {
        cost[i][0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const bool same = a[i - 1] == b[j - 1];
            cost[i][j] = std::min(
                {cost[i - 1][j] + 1, cost[i][j - 1] + 1, cost[i - 1][j - 1] + (same ? 0 : 1)});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                cost[i][j] = std::min(cost[i][j], cost[i - 2][j - 2] + 1);
        }
    }
    return cost[a.size()][b.size()];
}

/// One letter of so many may be wrong for a name to be probably meant.
constexpr std::size_t letters_of_a_typo = 3;

/// A shorter part of a name says nothing.
constexpr std::size_t shortest_part = 3;

/// More are not named: the part that they share says nothing either.
constexpr std::size_t most_meant = 3;

/// What is compared: nobody means another name by capitals, hyphens or blanks.
std::string letters_of(std::string_view text) {
    std::string letters;
    for (const char c : text)
        if (c != '-' && c != '_' && c != ' ')
            letters += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return letters;
}

std::string digits_of(std::string_view text) {
    std::string digits;
    std::copy_if(text.begin(), text.end(), std::back_inserter(digits),
                 [](unsigned char c) { return std::isdigit(c) != 0; });
    return digits;
}

bool begins_with(std::string_view text, std::string_view part) {
    return text.substr(0, part.size()) == part;
}

/// Other digits are another thing: a part, an output.
bool same_digits(std::string_view a, std::string_view b) {
    const std::string left = digits_of(a);
    const std::string right = digits_of(b);
    return begins_with(left, right) || begins_with(right, left);
}

/// How far `name` is from what was written; none: too far to have been meant. A name of which a
/// whole part was left out, such as its unit, is near; one that was continued is, too.
std::optional<std::size_t> distance(std::string_view written, std::string_view name) {
    const std::string text = letters_of(written);
    const std::string letters = letters_of(name);
    if (text.empty() || !same_digits(text, letters)) return std::nullopt;
    const std::string last_part = '_' + std::string(written);
    const bool ends = written.size() >= shortest_part && name.size() > last_part.size() &&
                      name.substr(name.size() - last_part.size()) == last_part;
    if (ends || (text.size() > 1 && begins_with(letters, text))) return 0;
    const std::size_t edits = edit_distance(text, letters);
    const bool continued = letters.size() >= shortest_part && begins_with(text, letters);
    if (continued || edits <= text.size() / letters_of_a_typo) return edits;
    return std::nullopt;
}

/// Those of `names` that were probably meant: the nearest, of which several may be as near.
std::vector<std::string> probably_meant(std::string_view written,
                                        const std::vector<std::string>& names) {
    std::vector<std::string> found;
    std::size_t nearest = std::string::npos;
    for (const std::string& name : names) {
        const auto far = distance(clipped(written), name);
        if (!far || *far > nearest) continue;
        if (*far < nearest) found.clear();
        nearest = *far;
        found.push_back(name);
    }
    if (found.size() > most_meant) found.clear();
    return found;
}

/// The question that names them, each within `quote`; empty: none was meant.
std::string question(const std::vector<std::string>& meant, char quote) {
    if (meant.empty()) return "";
    return fmt::format("did you mean {0}{1}{0}?", quote,
                       fmt::join(meant, fmt::format("{0} or {0}", quote)));
}

/// A value may have come from another file.
TomlPlace place(const std::string& path, const toml::source_region& source) {
    return {source.path ? *source.path : path, source.begin.line, source.begin.column};
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
    if (status.type() == std::filesystem::file_type::not_found)
        return refuse("there is no such file", give);
    if (error) return refuse("cannot be opened: " + error.message(), give);
    // Devices and pipes may have no end.
    if (!std::filesystem::is_regular_file(status)) return refuse("is not a regular file", give);
    std::ifstream file(path, std::ios::binary);
    if (!file) return refuse("cannot be opened: " + std::generic_category().message(errno), give);
    std::string text(largest_file + 1, '\0');
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

/// Characters that word processors and web pages put in place of those of TOML.
struct Lookalike {
    std::string_view bytes;  ///< in UTF-8
    const char* name;
    const char* meant;
};
constexpr Lookalike lookalikes[]{{"\u201C", "a curly quote", "\""},
                                 {"\u201D", "a curly quote", "\""},
                                 {"\u201E", "a curly quote", "\""},
                                 {"\u201F", "a curly quote", "\""},
                                 {"\u2018", "a curly quote", "'"},
                                 {"\u2019", "a curly quote", "'"},
                                 {"\u201A", "a curly quote", "'"},
                                 {"\u201B", "a curly quote", "'"},
                                 {"\u00AB", "an angle quote", "\""},
                                 {"\u00BB", "an angle quote", "\""},
                                 {"\u2010", "a typographic hyphen", "-"},
                                 {"\u2011", "a typographic hyphen", "-"},
                                 {"\u2012", "a dash", "-"},
                                 {"\u2013", "a dash", "-"},
                                 {"\u2014", "a dash", "-"},
                                 {"\u2212", "a typographic minus", "-"},
                                 {"\u00A0", "a no-break space", " "},
                                 {"\u202F", "a no-break space", " "},
                                 {"\u2007", "a no-break space", " "},
                                 {"\u2009", "a thin space", " "},
                                 {"\u200B", "an invisible space", ""},
                                 {"\uFEFF", "an invisible space", ""}};

/// A line of a text, from 1, without its comment, and with no first byte of a longer character in
/// its strings: columns stay.
std::string bare_line(const std::string& text, std::uint32_t number) {
    std::istringstream lines(text);
    std::string line;
    while (number-- > 0 && std::getline(lines, line)) {
    }
    for (std::size_t at = 0; (at = line.find_first_of("\"'#", at)) < line.size(); ++at) {
        if (line[at] == '#') {
            line.resize(at);
        } else if (const auto end = line.find(line[at], at + 1); end != std::string::npos) {
            for (; at < end; ++at)
                if (static_cast<unsigned char>(line[at]) >= 0xC0) line[at] = ' ';
        }
    }
    return line;
}

/// The first of them on a line that is not TOML; none: that is not why.
std::optional<TomlProblem> find_lookalike(const std::string& text, const TomlPlace& failed) {
    const std::string line = bare_line(text, failed.line);
    std::size_t first = std::string::npos;
    const Lookalike* found = nullptr;
    for (const Lookalike& each : lookalikes)
        if (const std::size_t at = line.find(each.bytes); at < first) first = at, found = &each;
    if (found == nullptr) return std::nullopt;
    const auto column =
        std::count_if(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(first),
                      [](unsigned char c) { return (c & 0xC0) != 0x80; });
    const std::string meant = found->meant;
    return TomlProblem{{failed.path, failed.line, static_cast<std::uint32_t>(column) + 1},
                       "",
                       "",
                       fmt::format("there is {} here, which TOML does not know", found->name),
                       meant.empty()  ? "delete it, or type the line again"
                       : meant == " " ? "type a plain space instead"
                                      : fmt::format("type {} instead", meant)};
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
        if (const auto why = find_lookalike(text, place(path, error.source())))
            return Unexpected(*why);
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
                                                    const std::vector<std::string>& names,
                                                    std::string_view difference) {
    const toml::node* node = find(key);
    if (node == nullptr) return std::nullopt;
    const auto text = node->value_exact<std::string>();
    const auto found = text ? std::find(names.begin(), names.end(), *text) : names.end();
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
    refuse(key, fmt::format("one of {}", fmt::join(names, ", ")));
    const auto meant = text ? probably_meant(*text, names) : std::vector<std::string>{};
    if (!meant.empty()) file_.problems.back().cure = question(meant, '"');
    if (meant.size() > 1 && !difference.empty())
        file_.problems.back().cure += fmt::format(" {}", difference);
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
        std::string cure = question(probably_meant(key.str(), known_), '\'');
        if (cure.empty() && file_.cure_of_stray) cure = file_.cure_of_stray(title_, key.str());
        if (cure.empty()) cure = fmt::format("remove it; the keys are in {}", file_.manual);
        file_.problems.push_back({place(file_.path, key.source()), title_, std::string(key.str()),
                                  fmt::format("unknown key '{}'", clipped(key.str())), cure});
    }
}

TomlEntry TableReader::entry() const {
    TomlEntry entry{title_, place(file_.path, table_.source()), {}};
    for (const auto& [key, node] : table_)
        entry.keys.emplace(key.str(), place(file_.path, node.source()));
    return entry;
}

}  // namespace versavis
