// SPDX-License-Identifier: BSD-3-Clause
// Where the rings of an instance of the service lie.
#pragma once

#include <filesystem>
#include <string>

#include "export.hpp"

namespace versavis {

/// Name of the instance meant when none is given: $VERSAVIS_INSTANCE, else "default".
VERSAVIS_API std::string default_instance();

/// /dev/shm/versavis/<instance>
VERSAVIS_API std::filesystem::path instance_directory(const std::string& instance);

/// True when a stream can have this name: not empty, no '/', no '.' at its beginning.
VERSAVIS_API bool is_stream_name(const std::string& name);

/// /dev/shm/versavis/<instance>/<stream>
VERSAVIS_API std::filesystem::path stream_path(const std::string& instance,
                                               const std::string& stream);

/// The socket that the service is controlled by (docs/contracts/control.md).
inline std::filesystem::path control_path(const std::string& instance) {
    return instance_directory(instance) / ".control";
}

}  // namespace versavis
