// SPDX-License-Identifier: BSD-3-Clause
// What an item says by name, in JSON and as CSV, from the tables of its fields.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "versavis/fields.hpp"

namespace versavis::client {

/// Adds what the metadata say: null where they say nothing.
void add_fields(nlohmann::json& line, ring::StreamKind kind, const ring::Metadata& metadata,
                std::uint64_t attributes);
void add_fields(nlohmann::ordered_json& line, ring::StreamKind kind, const ring::Metadata& metadata,
                std::uint64_t attributes);

/// Names of columns, each behind a comma; of a vector one for each component: `gyro_rad_s_x`.
std::string field_columns(ring::StreamKind kind);

/// Their values, each behind a comma: nothing where the metadata say nothing, and 1 or 0 for flags.
std::string field_row(ring::StreamKind kind, const ring::Metadata& metadata,
                      std::uint64_t attributes);

/// In quotes where CSV needs them.
std::string csv_text(const std::string& text);

}  // namespace versavis::client
