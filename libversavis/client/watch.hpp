// SPDX-License-Identifier: BSD-3-Clause
// A file descriptor that becomes readable when something happens in one of several segments: what
// poll and epoll need, and a futex is not. A thread sleeps on the futexes and writes to it.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "client/process.hpp"
#include "client/segment.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::ring {

/// A segment, and what its reader knows of it already.
struct WatchTarget {
    std::shared_ptr<const Mapping> mapping;
    std::filesystem::path path;
    std::uint32_t seen{};  ///< value of `wake` before the reader looked, and found nothing
    bool gone{};           ///< it has reported that the writer is gone: only a successor is news
    FileId refused{};      ///< a file of this name that is no successor
    Pulse pulse{};         ///< what the reader knows of the writer's heart
};

/// True when there is a file of this name that its reader does not know.
bool has_successor(const std::filesystem::path& path, FileId known, FileId refused);

/// Serves the file descriptor of a reader. The reader's thread calls everything but run(), which is
/// the thread that sleeps on the futexes; `mutex_` guards what they share.
class Watch {
 public:
    /// Errors: no descriptor or thread available.
    static Expected<std::unique_ptr<Watch>> start();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;
    ~Watch();

    /// Readable from the beginning, until calm() is called.
    int fd() const { return event_.get(); }

    /// Makes it unreadable. Look for items *after* this, and arm() when there are none.
    void calm();

    void signal();  ///< makes it readable

    /// It becomes readable when something happens in one of the targets, or `deadline` comes.
    /// Replaces what it was armed for.
    void arm(std::vector<WatchTarget> targets, std::optional<HostTime> deadline);

 private:
    struct Watched {
        std::vector<WatchTarget> targets;
        std::optional<HostTime> deadline;
    };

    explicit Watch(FileDescriptor event) : event_(std::move(event)) {}
    void become(std::optional<Watched> watched, bool stop);
    void run();
    void keep(std::uint32_t version, Watched watched) const;
    bool outdated(std::uint32_t version) const;

    FileDescriptor event_;
    std::mutex mutex_;
    std::optional<Watched> watched_;        ///< none: the thread sleeps
    std::atomic<std::uint32_t> version_{};  ///< changes when the thread shall look up; its futex
    bool stop_ = false;
    std::thread thread_;
};

}  // namespace versavis::ring
