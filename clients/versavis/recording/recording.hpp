// SPDX-License-Identifier: BSD-3-Clause
// A recording, read back as the items that the rings held (docs/contracts/recording-format.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "versavis/error.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring_layout.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// Where an item lies, for at().
struct ItemPlace {
    static constexpr std::uint32_t no_image = 0xFFFFFFFFU;

    std::uint32_t file = 0;  ///< of a recording in several files
    std::uint32_t chunk = 0;
    std::uint32_t item = 0;          ///< in the chunk's records
    std::uint32_t image = no_image;  ///< of a frame: its image
};

/// An item as it was published. It is valid during the call that gets it.
struct RecordedItem {
    const std::string& stream;
    ring::StreamKind kind;
    std::uint64_t number;  ///< in its segment
    std::uint64_t life;    ///< of the service
    OutputTime time;
    ring::Metadata metadata;
    /// Of a frame its pixels, unpacked where they are PNG; none when the file does not have them.
    std::span<const std::byte> payload;
    std::uint32_t length;      ///< of the payload in the ring
    std::uint64_t attributes;  ///< of a frame: see SensorState
    ItemPlace place;
    std::span<const std::byte> png;  ///< of a frame that was recorded as PNG
};

struct RecordedStream {
    std::string name;
    ring::StreamKind kind;
    std::uint64_t items;
};

struct Attachment {
    std::string name;
    std::string media_type;
    std::string content;
};

/// What is not there, as the recorder reports it.
struct RecordedGap {
    std::string stream;
    std::string reason;  ///< lost, restarted, gone, epoch
    std::uint64_t items;
    OutputTime time;  ///< of the item before it
};

struct RecordingFacts {
    std::uint64_t files;     ///< of which the recording consists
    std::uint64_t bytes;     ///< of all
    std::string defect;      ///< why a file's summary is not used; empty: all are whole
    std::uint64_t good_end;  ///< bytes that can be read
    std::uint64_t chunks;
    std::string library;                          ///< that wrote it
    std::map<std::string, std::string> metadata;  ///< the Metadata record `versavis`
    std::vector<std::string> missing{};           ///< files of it that are not there
};

class Recording {
 public:
    /// Opens a recording: when `path` is the first of several files, also those after it. Errors:
    /// cannot be read, no MCAP file, no recording of ours, damaged (with the place).
    static Expected<Recording> open(const std::string& path);

    /// Opens this file alone.
    static Expected<Recording> open_file(const std::string& path);

    Recording(Recording&&) noexcept;
    Recording& operator=(Recording&&) noexcept;
    ~Recording();

    const std::vector<RecordedStream>& streams() const;
    const std::vector<Attachment>& attachments() const;
    const RecordingFacts& facts() const;

    /// Of its files, in their order.
    std::vector<std::string> paths() const;

    /// Null: there is none of this name.
    const Attachment* attachment(const std::string& name) const;

    using Take = std::function<bool(const RecordedItem&)>;

    /// Calls `take` with each item of the streams named (none named: of all), in the order of the
    /// file, until it returns false. What is damaged is left out, and is in damages().
    Expected<> for_each(const std::vector<std::string>& streams, const Take& take) const;

    /// The same without the pixels of frames, which are not even read; checksums are not checked.
    Expected<> glance(const std::vector<std::string>& streams, const Take& take) const;

    /// Calls `take` with the item at a place that an item named. Chunks that were read lately are
    /// kept, so that places nearly in order are read once. Errors: as of for_each().
    Expected<> at(const ItemPlace& place, const Take& take) const;

    Expected<std::vector<RecordedGap>> gaps() const;

    /// Reads all chunks once. What is damaged is left out from then on.
    void check() const;

    /// What was damaged so far, each with its place: it was passed over.
    std::vector<std::string> damages() const;

 private:
    struct File;
    Recording();
    void add(std::unique_ptr<File> file);
    void follow(const std::string& path);
    Expected<> in_each_file(const std::vector<std::string>& streams, const Take& take,
                            bool with_pixels) const;

    std::vector<std::unique_ptr<File>> files_;  ///< at least one
    std::vector<RecordedStream> streams_;
    RecordingFacts facts_{};
};

}  // namespace versavis::client
