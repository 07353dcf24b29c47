// SPDX-License-Identifier: BSD-3-Clause
#include "engine/toml/problem.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <utility>

namespace versavis {

namespace {

/// Most of a user's own text that a message repeats.
constexpr std::size_t longest_quotation = 80;

/// Ends of names of keys, and their units; the first that fits counts.
constexpr std::pair<std::string_view, std::string_view> units[]{
    {"_us", "us"},   {"_ms", "ms"},     {"_ppm_per_s", "ppm/s"}, {"_s", "s"},
    {"_hz", "Hz"},   {"_ppm", "ppm"},   {"_percent", "%"},       {"_mbps", "Mbit/s"},
    {"_c", "deg C"}, {"_baud", "baud"}, {"_size", "bytes"}};

}  // namespace

std::string TomlPlace::text() const {
    return line == 0 ? path : fmt::format("{}:{}:{}", path, line, column);
}

std::string TomlProblem::message() const {
    std::string text = Error(*this).message();
    std::replace_if(
        text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, '?');
    return text;
}

const TomlPlace& TomlEntry::place_of(const std::string& key) const {
    const auto found = keys.find(key);
    return found == keys.end() ? place : found->second;
}

std::string TomlEntry::reference(const std::string& key) const {
    if (title.empty()) return fmt::format("'{}'", key);
    return fmt::format("{}: '{}' of {}", place_of(key).text(), key, title);
}

TomlProblem TomlEntry::problem(const std::string& key, std::string what, std::string cure) const {
    return {place_of(key), title, key, std::move(what), std::move(cure)};
}

std::string_view unit_of(std::string_view key) {
    for (const auto& [end, unit] : units)
        if (key.size() >= end.size() && key.substr(key.size() - end.size()) == end) return unit;
    return "";
}

std::string quantity(std::string_view key, double value) {
    const std::string_view unit = unit_of(key);
    return fmt::format("{:.10g}{}{}", value, unit.empty() ? "" : " ", unit);
}

std::string clipped(std::string_view text) {
    if (text.size() <= longest_quotation) return std::string(text);
    std::size_t end = longest_quotation;  // not within a character of several bytes
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
    return std::string(text.substr(0, end)) + "...";
}

}  // namespace versavis
