// SPDX-License-Identifier: BSD-3-Clause
// A socket that passes a sealed segment to every client that connects, unasked.
#pragma once

#include <filesystem>
#include <memory>
#include <thread>

#include "client/segment.hpp"
#include "versavis/error.hpp"

namespace versavis::ring {

/// Runs one thread from open() until destruction. The writer creates and destroys it; nothing else
/// is shared with it.
class SegmentServer {
 public:
    /// Listens at `path`, which may be renamed, until destroyed; owner and group may connect.
    /// Errors: the socket cannot be created there, or no thread can be started.
    static Expected<std::unique_ptr<SegmentServer>> open(const std::filesystem::path& path,
                                                         FileDescriptor segment);

    /// True: `path` is the socket of a server whose process has ended.
    static bool is_deserted(const std::filesystem::path& path);

    SegmentServer(const SegmentServer&) = delete;
    SegmentServer& operator=(const SegmentServer&) = delete;
    ~SegmentServer();

 private:
    SegmentServer(FileDescriptor segment, FileDescriptor socket);
    void serve() const;

    FileDescriptor segment_;
    FileDescriptor socket_;
    std::thread thread_;
};

}  // namespace versavis::ring
