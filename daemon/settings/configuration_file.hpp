// SPDX-License-Identifier: BSD-3-Clause
// The configuration from a file that was parsed.
#pragma once

#include <toml++/toml.h>
#include <string>

#include "configuration.hpp"

namespace versavis::daemon {

/// `path` is what problems call the file. Errors: as of load_configuration().
Expected<Configuration, TomlProblems> read_configuration(const toml::table& root,
                                                         const std::string& path);

}  // namespace versavis::daemon
