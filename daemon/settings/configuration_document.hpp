// SPDX-License-Identifier: BSD-3-Clause
// The configuration as it is in force: the file, and what was changed since it was read.
#pragma once

#include <toml++/toml.h>
#include <string>
#include <utility>
#include <vector>

#include "configuration.hpp"

namespace versavis::daemon {

/// One key whose value differs.
struct KeyChange {
    std::string table;  ///< such as "camera"; empty: the top of the file
    std::string name;   ///< of a camera or an IMU; empty: the table has none
    std::string key;    ///< empty: the table as a whole came or went

    /// Such as "camera.cam0.rate_hz".
    std::string text() const;

    /// Takes effect while the service runs; else with its next start.
    bool live() const;
};

/// Values of keys and features of one camera, by name.
using NewValues = std::vector<std::pair<std::string, std::string>>;

struct ConfigurationDocument {
    toml::table root;
    Configuration configuration;

    /// Errors: as of load_configuration().
    static Expected<ConfigurationDocument, TomlProblems> load(const std::string& path);

    /// This one with what is live of `next`. Errors: the two do not go together.
    Expected<ConfigurationDocument, TomlProblems> with_live_keys_of(const toml::table& next) const;

    /// This one with new values of one camera, which is there; what is no key of a camera is a
    /// feature. Each value is TOML, and "" removes what is there. Errors: as of
    /// load_configuration(), without lines.
    Expected<ConfigurationDocument, TomlProblems> with(const std::string& camera,
                                                       const NewValues& values) const;

 private:
    Expected<ConfigurationDocument, TomlProblems> made_of(toml::table root) const;
};

/// In the order of tables and keys.
std::vector<KeyChange> changes(const toml::table& before, const toml::table& after);

}  // namespace versavis::daemon
