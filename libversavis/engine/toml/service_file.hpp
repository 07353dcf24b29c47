// SPDX-License-Identifier: BSD-3-Clause
// The service's configuration as one table: the file FILE, and over it those in the folder FILE.d.
// Each value knows the file and the line that it came from.
#pragma once

#include <toml++/toml.h>
#include <string>
#include <vector>

#include "engine/toml/problem.hpp"
#include "versavis/error.hpp"

namespace versavis {

/// FILE, then those of FILE.d that end in .toml and do not begin with a dot, by name; without such
/// a folder FILE alone. Errors: the folder cannot be read.
Expected<std::vector<std::string>, TomlProblem> service_files(const std::string& path);

/// Tables are merged key by key, and [[camera]] and [[imu]] those that have one name; any other
/// value of a later file replaces the earlier one. Errors: all files that cannot be read or parsed,
/// and names that one file beside FILE has twice.
Expected<toml::table, TomlProblems> parse_service_file(const std::string& path);

/// What parse_service_file() gives, as TOML that begins with the names of its files; FILE alone, as
/// it is. Errors: as there, the first of them.
Expected<std::string> service_text(const std::string& path);

}  // namespace versavis
