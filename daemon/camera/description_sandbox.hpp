// SPDX-License-Identifier: BSD-3-Clause
// Which camera descriptions may be parsed in the service: those that a probe process found good,
// now or in an earlier life.
#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "camera/description.hpp"

namespace versavis::daemon {

/// Thread-safe.
class DescriptionSandbox {
 public:
    /// `program` is run as "program --probe-description xml|zip". Good descriptions are kept by
    /// their hash in a file of the directory; where it cannot be written, until the service ends.
    DescriptionSandbox(std::filesystem::path program, const std::filesystem::path& directory);

    /// Errors: why it is refused, or that it was cancelled.
    Expected<> vet(const std::string& camera, const Description& description,
                   const Cancelled& cancelled);

 private:
    std::optional<std::string> known(const std::string& hash) const;
    void remember(const std::string& hash, const std::string& refused, bool slow);
    void keep(const std::string& hash);

    std::filesystem::path program_;
    std::filesystem::path file_;
    mutable std::mutex mutex_;
    std::set<std::string> good_;
    std::map<std::string, std::string> refused_;  ///< and why, for this life
    std::map<std::string, unsigned> slow_;        ///< probes that used up their CPU time
};

/// This program.
inline constexpr const char* own_program = "/proc/self/exe";

}  // namespace versavis::daemon
