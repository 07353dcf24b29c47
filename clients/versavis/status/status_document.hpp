// SPDX-License-Identifier: BSD-3-Clause
// Reads the service's status document from its ring.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "versavis/stream.hpp"

namespace versavis::client {

/// The newest document of `instance`. Errors: the service is not running, its process has ended, or
/// its heart has not beaten for three seconds.
Expected<nlohmann::json> read_status(const std::string& instance);

/// Why there is no status: what a service that has not started to serve waits for, or that it
/// failed, if systemd knows that, else `error`.
Error explain_silence(const Error& error);

/// The same by what 'systemctl show' says of Id, ActiveState and StatusText of the services; none:
/// nothing.
std::optional<Error> why_silent(const std::string& units);

/// The file that is named, else the one that the service has read, else the installed one.
std::string configuration_path(const std::string& named,
                               const std::optional<nlohmann::json>& status);

/// Why `stream` cannot be read: what the service says is wrong with the device of this name, if it
/// says so, else `error`.
Error explain(const Error& error, const std::string& instance, const std::string& stream);

}  // namespace versavis::client
