// SPDX-License-Identifier: BSD-3-Clause
#include "recording/item_fields.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <type_traits>

namespace versavis::client {

namespace {

constexpr const char* components[] = {"_x", "_y", "_z"};

template <class Json>
Json to_json(const FieldValue& value) {
    return std::visit(
        [](const auto& known) {
            if constexpr (std::is_same_v<std::decay_t<decltype(known)>, std::monostate>)
                return Json(nullptr);
            else
                return Json(known);
        },
        value);
}

template <class Json>
void add(Json& line, ring::StreamKind kind, const ring::Metadata& metadata,
         std::uint64_t attributes) {
    for (const Field& field : fields_of(kind)) {
        if (field.count == 1) {
            line[field.name] = to_json<Json>(value_of(field, metadata, attributes));
            continue;
        }
        Json vector = Json::array();
        for (unsigned i = 0; i < field.count; ++i)
            vector.push_back(to_json<Json>(value_of(field, metadata, attributes, i)));
        line[field.name] = std::move(vector);
    }
}

std::string to_csv(const FieldValue& value) {
    return std::visit(
        [](const auto& known) -> std::string {
            using T = std::decay_t<decltype(known)>;
            if constexpr (std::is_same_v<T, std::monostate>)
                return "";
            else if constexpr (std::is_same_v<T, bool>)
                return known ? "1" : "0";
            else if constexpr (std::is_same_v<T, std::string>)
                return csv_text(known);
            else
                return fmt::format("{}", known);
        },
        value);
}

}  // namespace

void add_fields(nlohmann::json& line, ring::StreamKind kind, const ring::Metadata& metadata,
                std::uint64_t attributes) {
    add(line, kind, metadata, attributes);
}

void add_fields(nlohmann::ordered_json& line, ring::StreamKind kind, const ring::Metadata& metadata,
                std::uint64_t attributes) {
    add(line, kind, metadata, attributes);
}

std::string field_columns(ring::StreamKind kind) {
    std::string columns;
    for (const Field& field : fields_of(kind))
        for (unsigned i = 0; i < field.count; ++i)
            columns += fmt::format(",{}{}", field.name, field.count == 1 ? "" : components[i]);
    return columns;
}

std::string field_row(ring::StreamKind kind, const ring::Metadata& metadata,
                      std::uint64_t attributes) {
    std::string row;
    for (const Field& field : fields_of(kind))
        for (unsigned i = 0; i < field.count; ++i)
            row += "," + to_csv(value_of(field, metadata, attributes, i));
    return row;
}

std::string csv_text(const std::string& text) {
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string result = "\"";
    for (const char one : text) result += one == '"' ? "\"\"" : std::string(1, one);
    return result + "\"";
}

}  // namespace versavis::client
