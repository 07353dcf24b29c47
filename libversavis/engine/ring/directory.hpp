// SPDX-License-Identifier: BSD-3-Clause
// Ownership of an instance's directory of rings: one service at a time.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/segment.hpp"
#include "engine/ring/epoch_block.hpp"
#include "versavis/error.hpp"

namespace versavis::ring {

/// Owned until this is destroyed.
class OwnedDirectory {
 public:
    /// Creates `path` (0750) if needed and locks it for this process. Segments that a dead owner
    /// left are kept until remove_stale(), so that their readers can be handed over. Errors: no
    /// permission, another service owns it, others may write there.
    static Expected<OwnedDirectory> claim(const std::filesystem::path& path);

    OwnedDirectory(OwnedDirectory&&) noexcept = default;
    OwnedDirectory& operator=(OwnedDirectory&&) = delete;

    /// Retires and removes the segments that another process made, except those named in `keep`:
    /// their readers move on when the segment is created again.
    void remove_stale(const std::vector<std::string>& keep) const;

    const std::filesystem::path& path() const { return path_; }

    /// Numbers of epochs, unique over all runs that used this directory.
    EpochBlock& epochs() { return epochs_; }

 private:
    OwnedDirectory(std::filesystem::path path, FileDescriptor lock)
        : path_(std::move(path)), lock_(std::move(lock)), epochs_(lock_.get()) {}

    std::filesystem::path path_;
    FileDescriptor lock_;
    EpochBlock epochs_;  ///< in the file that is locked
};

}  // namespace versavis::ring
