// SPDX-License-Identifier: BSD-3-Clause
// Asymmetries of links that PPS measured, kept by port for when there is no PPS.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "engine/clock/asymmetry.hpp"
#include "versavis/error.hpp"

namespace versavis::daemon {

class AsymmetryStore {
 public:
    /// `directory` holds, or will hold, asymmetry.json; empty: systemd's StateDirectory, or
    /// /var/lib/versavis.
    explicit AsymmetryStore(const std::string& directory);

    /// None: nothing is known of this port. Sigma is that of another day: larger than when it was
    /// measured. Error: the file cannot be read or understood.
    Expected<std::optional<clock::Asymmetry>> load(const std::string& port) const;

    /// The file appears whole, or stays as it was. Error: it cannot be written.
    Expected<> save(const std::string& port, const clock::Asymmetry& asymmetry) const;

    const std::filesystem::path& path() const { return path_; }

 private:
    std::filesystem::path path_;
};

}  // namespace versavis::daemon
