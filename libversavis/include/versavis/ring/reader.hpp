// SPDX-License-Identifier: BSD-3-Clause
// A reader of a shared-memory ring: read-only, and independent of what becomes of the writer and of
// other readers.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "versavis/error.hpp"
#include "versavis/export.hpp"
#include "versavis/ring/layout.hpp"
#include "versavis/time.hpp"

namespace versavis::ring {

/// What a look at the ring found.
enum class Found {
    item,       ///< an item, the next in order
    nothing,    ///< nothing new (in the time given)
    lost,       ///< items were overwritten before they were read; reading continues with newer ones
    restarted,  ///< the service was restarted; reading continues with its first item
    gone,       ///< the writer has closed or died, and there is no new one yet; look again later
};

struct Item {
    Found found = Found::nothing;
    std::uint64_t lost = 0;    ///< with Found::lost: how many
    std::uint64_t number = 0;  ///< item number since the segment was made
    OutputTime time;
    Metadata metadata{};
    const std::byte* payload =
        nullptr;  ///< in the ring, until the next call; check intact() after reading
    std::uint32_t payload_size = 0;
    std::uint32_t slot = no_slot;
    std::uint64_t slot_generation = 0;
};

/// Not thread-safe: one thread at a time may call it; any number of readers may exist.
class VERSAVIS_API Reader {
 public:
    enum class From { newest, oldest };

    /// Maps `directory / name`. Errors: not there, not owned by the directory's owner, not a ring,
    /// unknown layout.
    static Expected<Reader> open(const std::filesystem::path& path, From from = From::newest);

    Reader(Reader&&) noexcept;
    Reader& operator=(Reader&&) noexcept;
    ~Reader();

    /// The next item, without waiting.
    Item next();

    /// The next item, waiting for it up to `timeout` in the kernel.
    Item wait(Duration timeout);

    /// True while the payload of `item` has not been touched by the writer: what was read of it
    /// before is good.
    bool intact(const Item& item) const;

    /// Copies the payload (item.payload_size bytes) to `destination`; false when the writer
    /// overtook the copy.
    bool copy(const Item& item, std::byte* destination) const;

    StreamKind kind() const;
    const char* name() const;
    std::uint64_t head() const;      ///< items published so far
    std::uint64_t retained() const;  ///< how many items can be read at any one time
    HostTime last_heartbeat() const;
    std::uint32_t writer_pid() const;
    bool writer_found() const;  ///< its process runs, as far as this one can see
    bool writer_alive()
        const;  ///< its state is live and its heartbeat is younger than three seconds

 private:
    struct Segment;
    Reader(std::filesystem::path path, std::unique_ptr<Segment> segment);
    static Expected<std::unique_ptr<Segment>> map(const std::filesystem::path& path);
    Item read_descriptor(std::uint64_t number) const;
    Item lapped();
    Item idle();

    std::filesystem::path path_;
    std::unique_ptr<Segment> segment_;
    std::uint64_t next_ = 0;
};

}  // namespace versavis::ring
