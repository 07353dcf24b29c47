// SPDX-License-Identifier: BSD-3-Clause
// A reader of a shared-memory ring: read-only, and independent of what becomes of the writer and of
// other readers.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "error.hpp"
#include "export.hpp"
#include "ring_layout.hpp"
#include "ring_payload.hpp"
#include "time.hpp"

namespace versavis {
class WaitSet;
}

namespace versavis::ring {

struct FutexWord;
struct WatchTarget;

/// Why there is no item.
enum class Pause : std::uint32_t {
    nothing = 1,    ///< nothing new (in the time given)
    lost = 2,       ///< items were overwritten before they were read
    restarted = 3,  ///< the service was restarted: what comes next is its first item
    gone = 4,       ///< the service has stopped or died, and there is no new one yet
};

/// There is no item. Whatever the reason, just call again: the reader goes on by itself.
struct NoItem {
    Pause why = Pause::nothing;
    std::uint64_t lost = 0;  ///< with Pause::lost: how many

    VERSAVIS_API std::string message() const;
};

struct Item {
    std::uint64_t number = 0;  ///< since the segment was made
    EpochTime time;            ///< that of a status document has no epoch
    Metadata metadata{};
    bool stale = false;  ///< its writer was dead, or had closed the stream, when this was read
    Payload payload;

    /// True while the payload has not been touched by the writer; always, without payload.
    bool valid() const { return payload.valid(); }
};

using Received = Expected<Item, NoItem>;

/// A place in the stream.
enum class Position {
    next,    ///< the item that will be published next
    latest,  ///< the newest item that there is
    middle,  ///< half a ring back, or less when it holds less
    oldest,  ///< the oldest item that is not about to be overwritten
};

struct Options {
    Position start = Position::next;
    Position after_loss = Position::middle;  ///< where to go on when items were lost
    /// User id that the stream must belong to. None: that of the name or number in $VERSAVIS_OWNER;
    /// without it root, this process's user, or `versavis`.
    std::optional<std::uint32_t> owner{};
    /// Only streams that no one, not even their owner, can cut short, which would end a reading
    /// program with SIGBUS: not those of a service with `sealed = false`.
    bool sealed_only = false;
    /// How long open() waits for a stream that is not there yet.
    Duration wait{};
};

/// Not thread-safe: one thread at a time may call it; any number of readers may exist.
class VERSAVIS_API Reader {
 public:
    /// Maps `path`. Errors: absent (in the time that `options` give it), forbidden, not_trusted,
    /// damaged, unsupported, no_memory, exhausted.
    static Expected<Reader> open(const std::filesystem::path& path, const Options& options = {});

    Reader(Reader&&) noexcept;
    Reader& operator=(Reader&&) noexcept;
    ~Reader();

    /// The next item, without waiting.
    Received next();

    /// The next item, waiting for it up to `timeout` in the kernel. Returns Pause::gone at once the
    /// first time, and after `timeout` from then on.
    Received next(Duration timeout);

    /// The newest item, passing over older ones without calling them lost; if it has been read
    /// already, waits up to `timeout` for the next.
    Received latest(Duration timeout = {});

    /// Sleeps until next() may have something to return, for `timeout` at most.
    void wait(Duration timeout);

    /// Goes to a place among the items that there are.
    void seek(Position position);

    /// Goes to the oldest item from which on none is before `time` (items of later epochs are not);
    /// or to one that is so many `earlier`, if there are. False: `time` is of another life, or of
    /// no epoch, as are the items of a status stream; it stays where it is.
    bool seek(const EpochTime& time, std::uint64_t earlier = 0);

    /// A file descriptor for poll or epoll, the reader's own: readable when a call of next() may
    /// find something, until one finds nothing. Errors: no descriptor or thread available.
    Expected<int> fd();

    StreamKind kind() const;
    const char* name() const;
    std::uint64_t life() const;
    std::uint64_t head() const;      ///< items published so far
    std::uint64_t retained() const;  ///< how many items can be read at any one time, at most
    HostTime last_heartbeat() const;
    std::uint32_t writer_pid() const;
    bool writer_alive();  ///< its stream is open, its process there, and its heart beats

 private:
    friend class versavis::WaitSet;
    enum class Look { ready, not_yet, overwritten };
    struct Contact;

    Reader(std::filesystem::path path, const Options& options,
           std::shared_ptr<const Mapping> mapping);
    Look read(std::uint64_t number, Item& item) const;
    bool readable(std::uint64_t number) const;
    std::uint64_t oldest() const;
    std::uint64_t place(Position position) const;
    Received take();
    Received look();
    Received lapped();
    Received hand_over();
    Received gone();
    bool not_there() const;
    void let_go();
    Received settle();
    bool writer_seen();
    bool ready();
    std::optional<HostTime> retry() const;
    FutexWord wake_word();
    WatchTarget target(std::uint32_t seen) const;

    std::filesystem::path path_;
    Options options_;
    std::shared_ptr<const Mapping> mapping_;
    std::unique_ptr<Contact> contact_;
    std::uint64_t next_ = 0;
};

}  // namespace versavis::ring
