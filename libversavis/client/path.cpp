// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/ring_path.hpp"

#include <cstdlib>

namespace versavis {

std::string default_instance() {
    const char* name = std::getenv("VERSAVIS_INSTANCE");
    return name != nullptr && *name != '\0' ? name : "default";
}

std::filesystem::path instance_directory(const std::string& instance) {
    return std::filesystem::path("/dev/shm/versavis") / instance;
}

bool is_stream_name(const std::string& name) {
    return !name.empty() && name.front() != '.' && name.find('/') == std::string::npos;
}

std::filesystem::path stream_path(const std::string& instance, const std::string& stream) {
    return instance_directory(instance) / stream;
}

}  // namespace versavis
