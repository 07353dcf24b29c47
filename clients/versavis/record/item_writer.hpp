// SPDX-License-Identifier: BSD-3-Clause
// Items of rings as messages of a recording (docs/contracts/recording-format.md).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "recording/item_messages.hpp"
#include "recording/lenses.hpp"
#include "recording/mcap_writer.hpp"
#include "versavis/error.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring_reader.hpp"

namespace versavis::client {

/// Why items of a stream are not there.
enum class GapReason { lost, restarted, gone, epoch };

const char* to_string(GapReason reason);

/// One file. Streams are announced in it when their first item comes.
class ItemWriter {
 public:
    /// `lenses`: of the cameras of which they are known.
    explicit ItemWriter(McapWriter file, Lenses lenses = {})
        : file_(std::move(file)), lenses_(std::move(lenses)) {}

    /// What came of an item.
    enum class Outcome { written, overtaken };

    /// Anything but a frame.
    Outcome write(const std::string& stream, ring::StreamKind kind, const ring::Item& item);

    /// A frame: its pixels go from the ring to the file, and are taken back if they were
    /// overwritten meanwhile. Error: the disk's.
    Expected<Outcome> write_frame(const std::string& stream, const ring::Item& item);

    /// A frame whose pixels are a PNG.
    Expected<> write_png(const std::string& stream, const ring::Item& item,
                         const std::vector<std::byte>& png);

    /// After the item of the stamp `last`; it stands in the file at `time`.
    void write_gap(const std::string& stream, GapReason reason, std::uint64_t items,
                   OutputTime last, OutputTime time, std::uint32_t epoch);

    McapWriter& file() { return file_; }
    const McapWriter& file() const { return file_; }

 private:
    /// Of a stream: numbers of its channels by their topic, and what its messages need to know.
    struct Channels {
        std::map<std::string, std::uint16_t> by_topic;
        std::uint32_t sequence = 0;
        float temperature = -1e9F;   ///< as last written
        std::int64_t status_ns = 0;  ///< when the status was last written
    };

    std::uint16_t channel(Channels& channels, const std::string& stream, const std::string& topic,
                          std::string_view type,
                          std::optional<ring::StreamKind> kind = std::nullopt);
    void write_item(Channels& channels, const std::string& stream, const ItemMessage& item);
    void write_frame_notes(Channels& channels, const std::string& stream, const ItemMessage& item);
    void write_imu(Channels& channels, const std::string& stream, const ring::Item& item);
    void write_event(Channels& channels, const std::string& stream, const ItemMessage& item);
    void write_status(Channels& channels, const std::string& stream, const ring::Item& item,
                      const std::string& document);

    McapWriter file_;
    Lenses lenses_;
    std::map<std::string, Channels> streams_;
};

}  // namespace versavis::client
