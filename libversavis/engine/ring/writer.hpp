// SPDX-License-Identifier: BSD-3-Clause
// The one writer of a shared-memory ring: it never waits for a reader.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "versavis/error.hpp"
#include "versavis/ring_layout.hpp"
#include "versavis/time.hpp"

namespace versavis::ring {

/// What a ring holds. Rings of inline items (IMU samples, events) have no slots.
struct Shape {
    std::string name;
    StreamKind kind = StreamKind::events;
    std::uint32_t descriptor_count = 1024;  ///< a power of two
    std::uint32_t slot_count = 0;
    std::uint64_t slot_size = 0;   ///< bytes of payload that one slot holds; rounded up to pages
    std::uint64_t first_item = 0;  ///< number of the first item; tests start it near a wrap
    std::uint64_t life = 0;        ///< 0: that of this process
    /// Items whose slots stay as they are; the slot that became free last of the others is the next
    /// to be written, while it is in the processor's caches. 0: the oldest item's is, so that as
    /// many items as possible stay readable.
    std::uint32_t kept = 0;
};

/// A ring without history keeps these: a reader has two periods for a frame, and the frames of a
/// set may be one period apart. Half: a reader that takes longer than a period loses frames. Twice:
/// two frames more in the caches.
constexpr std::uint32_t newest_kept = 2;

/// What `kept` items need: readers go on at half as many items before the newest as there are
/// descriptors.
constexpr std::uint32_t descriptors_of_kept(std::uint32_t kept) { return 2 * kept; }

/// Where rings are made, and how.
struct Place {
    Place(std::filesystem::path in, bool seal = false) : directory(std::move(in)), sealed(seal) {}

    std::filesystem::path directory;
    /// Nobody can cut a ring short under its readers: it is no file, and a socket hands it to them.
    bool sealed;
};

/// Not thread-safe: one thread at a time may call it. Readers never block it.
class Writer {
 public:
    /// Makes the segment `place.directory / shape.name`, its memory allocated and populated. A
    /// segment that an earlier writer left there is marked superseded and its readers are woken.
    /// Where memory is short, the rings of dead writers in the directory lose their names, and
    /// their readers have half a second to let go of them. Errors: the file cannot be created, or
    /// its memory not reserved.
    static Expected<Writer> create(const Place& place, const Shape& shape);

    Writer(Writer&&) noexcept;
    Writer& operator=(Writer&&) noexcept;
    ~Writer();  ///< closes the stream, wakes its readers and removes the segment's name

    /// Takes a free slot, by `Shape::kept`; readers lose the item in it from here on. None when all
    /// are taken.
    std::optional<std::uint32_t> acquire();
    std::byte* slot_data(std::uint32_t slot) const;
    std::uint64_t slot_size() const;
    std::uint32_t slot_count() const;

    /// Gives an acquired slot back without publishing it.
    void abandon(std::uint32_t slot);

    /// Publishes an acquired slot with `length` bytes of payload. Cost does not depend on the
    /// length.
    void publish(std::uint32_t slot, std::uint32_t length, OutputTime time,
                 const Metadata& metadata, std::uint64_t attributes = no_attributes);

    /// Publishes an item without payload.
    void publish(OutputTime time, const Metadata& metadata);

    /// Items published so far, the number of the next one.
    std::uint64_t head() const;

    /// Updates the heartbeat; call it at least once a second.
    void heartbeat(HostTime now);

 private:
    struct Segment;
    Writer(std::unique_ptr<Segment> segment, std::uint32_t kept);
    void write_descriptor(std::uint64_t slot_generation, std::uint64_t length_and_slot,
                          OutputTime time, const Metadata& metadata);

    std::unique_ptr<Segment> segment_;
    std::uint32_t kept_;
    std::deque<std::uint32_t> free_;  ///< slots to hand out, the one longest untouched first
};

}  // namespace versavis::ring
