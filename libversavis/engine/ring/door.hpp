// SPDX-License-Identifier: BSD-3-Clause
// A socket that hands a sealed segment to whoever connects, without a word from them.
#pragma once

#include <filesystem>
#include <memory>
#include <thread>

#include "client/segment.hpp"
#include "versavis/error.hpp"

namespace versavis::ring {

class Door {
 public:
    /// Listens at `path`, which may be renamed, until destroyed; owner and group may connect.
    /// Errors: the socket cannot be made there, no thread to be had.
    static Expected<std::unique_ptr<Door>> open(const std::filesystem::path& path,
                                                FileDescriptor segment);
    Door(const Door&) = delete;
    Door& operator=(const Door&) = delete;
    ~Door();

 private:
    Door(FileDescriptor segment, FileDescriptor socket);
    void serve() const;

    FileDescriptor segment_;
    FileDescriptor socket_;
    std::thread thread_;
};

}  // namespace versavis::ring
