// SPDX-License-Identifier: BSD-3-Clause
// Reads the service's status document from its ring.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "versavis/stream.hpp"

namespace versavis::client {

/// Arrays of the document whose objects are devices, with a name and a health.
inline constexpr const char* device_arrays[] = {"cameras", "imus", "time_outputs", "lidars"};

/// The newest document of `instance`. Errors: the service is not running, its process has ended, or
/// its heart has not beaten for three seconds.
Expected<nlohmann::json> read_status(const std::string& instance);

/// What a service of this host waits for before it serves, or that one failed, as systemd has it;
/// none: neither. Units and instances may have different names, so it may be of another instance.
std::optional<Error> why_silent();

/// The same by what 'systemctl show' says of Id, ActiveState and StatusText of the services.
std::optional<Error> why_silent(const std::string& units);

/// The error of read_status, with that beside its cure.
Error explain_silence(Error error);

/// The file that is named, else the one that the service has read, else the installed one.
std::string configuration_path(const std::string& named,
                               const std::optional<nlohmann::json>& status);

/// By which the service set up the camera `name`; empty: not known.
std::string preset_of(const nlohmann::json& status, const std::string& name);

/// Why `stream` cannot be read: what the service says is wrong with the device of this name, if it
/// says so, else `error`.
Error explain(const Error& error, const std::string& instance, const std::string& stream);

}  // namespace versavis::client
