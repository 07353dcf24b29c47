// SPDX-License-Identifier: BSD-3-Clause
// Which camera of the configuration has which device: no device is two cameras.
#pragma once

#include <map>
#include <mutex>
#include <string>

namespace versavis::daemon {

/// Thread-safe.
class DeviceLocks {
 public:
    /// The device is the camera's, and what it had before is free. Returns the name of the camera
    /// that has it already; empty: none other.
    std::string claim(const std::string& camera, const std::string& device) {
        const std::lock_guard lock(mutex_);
        for (const auto& [holder, held] : devices_)
            if (held == device && holder != camera) return holder;
        devices_[camera] = device;
        return "";
    }

 private:
    std::mutex mutex_;
    std::map<std::string, std::string> devices_;  ///< by camera
};

}  // namespace versavis::daemon
