// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>

namespace versavis::client {

namespace {

constexpr std::size_t absent = SIZE_MAX;

std::string_view trimmed(std::string_view text) {
    constexpr const char* blank = " \t\r";
    const auto begin = text.find_first_not_of(blank);
    if (begin == std::string_view::npos) return {};
    return text.substr(begin, text.find_last_not_of(blank) - begin + 1);
}

/// A file may contain anything: what is quoted from it must not garble the terminal.
std::string shown(std::string_view text, std::size_t most = 40) {
    std::string out;
    for (const char c : text.substr(0, most)) {
        const bool printable = c >= ' ' && c <= '~';
        out +=
            printable ? std::string(1, c) : fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    }
    return out + (text.size() > most ? "..." : "");
}

/// Splits at commas outside of quotes, without the quotes. False: a quote is not closed.
bool split(std::string_view line, std::vector<std::string_view>& fields) {
    fields.clear();
    bool quoted = false;
    std::size_t begin = 0;
    for (std::size_t i = 0; i <= line.size(); ++i) {
        if (i < line.size() && line[i] == '"') quoted = !quoted;
        if (i < line.size() && (quoted || line[i] != ',')) continue;
        std::string_view field = trimmed(line.substr(begin, i - begin));
        if (field.size() >= 2 && field.front() == '"' && field.back() == '"')
            field = trimmed(field.substr(1, field.size() - 2));
        fields.push_back(field);
        begin = i + 1;
    }
    return !quoted;
}

class Reader {
 public:
    Reader(const std::string& name, const CsvColumns& wanted) : name_(name) {
        names_ = wanted.required;
        names_.insert(names_.end(), wanted.optional.begin(), wanted.optional.end());
        required_ = wanted.required.size();
        table_.columns.resize(names_.size());
    }

    Expected<CsvTable> read(std::istream& in) {
        for (std::string line; std::getline(in, line); line.clear()) {
            std::string_view text = line;
            if (++number_ == 1 && text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
            text = trimmed(text);
            if (text.empty()) continue;
            const auto done = width_ == 0 ? take_header(text) : take_row(text);
            if (!done) return Unexpected(done.error());
        }
        if (in.bad()) return failure(name_, "cannot be read to the end", "is it a file?");
        if (width_ == 0)
            return failure(name_, "is empty", "its first line must name its columns: " + needed());
        return std::move(table_);
    }

 private:
    std::string line() const { return fmt::format("{}, line {}", name_, number_); }
    std::string needed() const {
        return fmt::format("{}",
                           fmt::join(names_.begin(), names_.begin() + offset(required_), ","));
    }
    static std::ptrdiff_t offset(std::size_t index) { return static_cast<std::ptrdiff_t>(index); }

    Expected<void> take_header(std::string_view text) {
        if (!split(text, fields_)) return unclosed();
        width_ = fields_.size();
        for (std::size_t i = 0; i < names_.size(); ++i) {
            const auto found = std::find(fields_.begin(), fields_.end(), names_[i]);
            if (found == fields_.end() && i < required_) return missing(names_[i], text);
            if (found != fields_.end() && std::count(found, fields_.end(), names_[i]) > 1)
                return failure(line(), fmt::format("column {} appears twice", names_[i]),
                               "rename one of the two");
            positions_.push_back(found == fields_.end()
                                     ? absent
                                     : static_cast<std::size_t>(found - fields_.begin()));
        }
        return {};
    }

    Expected<void> missing(const std::string& name, std::string_view header) const {
        const bool other_separator =
            fields_.size() == 1 && header.find_first_of(";\t") != header.npos;
        return failure(line(),
                       fmt::format("no column {}; columns found: {}", name, shown(header, 200)),
                       other_separator ? "separate columns by commas"
                                       : "the first line must name the columns: " + needed());
    }

    Expected<void> unclosed() const {
        return failure(line(), "a quote is not closed", "close it on the same line, or remove it");
    }

    Expected<void> take_row(std::string_view text) {
        if (!split(text, fields_)) return unclosed();
        if (fields_.size() != width_) return wrong_width();
        for (std::size_t i = 0; i < names_.size(); ++i) {
            if (positions_[i] == absent) continue;
            auto done = take_field(i, fields_[positions_[i]]);
            if (!done) return done;
        }
        ++table_.rows;
        return {};
    }

    Expected<void> wrong_width() const {
        // Name the first column that is missing, so that nobody has to count commas.
        std::string what = fmt::format("{} fields instead of {}", fields_.size(), width_);
        for (std::size_t i = 0; i < names_.size(); ++i)
            if (positions_[i] != absent && positions_[i] >= fields_.size()) {
                what += fmt::format(", column {} is missing", names_[i]);
                break;
            }
        return failure(line(), what,
                       "every line needs as many fields as the first; was the file cut off?");
    }

    Expected<void> take_field(std::size_t column, std::string_view field) {
        std::int64_t value = 0;
        const char* end = field.data() + field.size();
        const auto [stopped, error] = std::from_chars(field.data(), end, value);
        if (error == std::errc() && stopped == end) {
            table_.columns[column].push_back(value);
            return {};
        }
        const std::string where = fmt::format("{}, column {}", line(), names_[column]);
        if (field.empty())
            return failure(where, "is empty", "write whole nanoseconds, or remove the line");
        if (error == std::errc::result_out_of_range && stopped == end)
            return failure(where, fmt::format("{} does not fit into 64 bits", shown(field)),
                           "is its unit nanoseconds?");
        return failure(where, fmt::format("'{}' is not an integer", shown(field)),
                       "write whole nanoseconds, without a point or an exponent");
    }

    std::string name_;
    std::vector<std::string> names_;
    std::size_t required_ = 0;
    std::vector<std::size_t> positions_;  ///< of names_ in the file
    std::size_t width_ = 0;
    std::uint64_t number_ = 0;
    std::vector<std::string_view> fields_;
    CsvTable table_;
};

}  // namespace

Expected<CsvTable> read_csv(std::istream& in, const std::string& name, const CsvColumns& columns) {
    return Reader(name, columns).read(in);
}

Expected<CsvTable> read_csv(const std::string& path, const CsvColumns& columns) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        return failure(path, "is a directory", "name a CSV file");
    std::ifstream file(path, std::ios::binary);
    if (!file) return failure(path, "cannot be read", "check its name and permissions");
    return read_csv(file, path, columns);
}

}  // namespace versavis::client
