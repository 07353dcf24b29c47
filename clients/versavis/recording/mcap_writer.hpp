// SPDX-License-Identifier: BSD-3-Clause
// Writes an MCAP file of chunks, with payloads straight from where they lie.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "posix/file.hpp"
#include "recording/mcap_summary.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// A channel, and the schema that it brings along.
struct McapTopic {
    std::string name;
    std::string encoding;  ///< of its messages
    std::string schema;
    std::string schema_encoding;
    std::string schema_text;
    std::map<std::string, std::string> metadata{};
};

/// Contents of the records that announce it.
std::string mcap_schema(std::uint16_t id, const McapTopic& topic);
std::string mcap_channel(std::uint16_t id, std::uint16_t schema, const McapTopic& topic);

struct MessageHead {
    std::uint16_t channel = 0;
    std::uint32_t sequence = 0;
    std::int64_t time_ns = 0;
    std::optional<std::uint64_t> publish_time{};  ///< none: the same
};

/// All errors are the disk's: the file is then good up to its last whole chunk, and close() may
/// still end it.
class McapWriter {
 public:
    /// Makes the file, and locks it: `versavis repair` leaves it alone. Errors: it is there
    /// already, it cannot be made.
    static Expected<McapWriter> create(const std::string& path, const std::string& library,
                                       const std::string& profile = "ros2");

    McapWriter(McapWriter&&) noexcept = default;
    McapWriter& operator=(McapWriter&&) noexcept = default;
    ~McapWriter() = default;

    /// Announced in each chunk before its first message there: a chunk that is damaged takes
    /// nothing from others.
    std::uint16_t add(const McapTopic& topic);

    /// Held until the chunk ends, or a message with a body is written.
    void write(const MessageHead& message, const std::string& data);

    /// Writes `data` and `body`, one behind the other, which are not copied. The body is read
    /// twice, for the file and for its checksum.
    Expected<> write(const MessageHead& message, const std::string& data,
                     std::span<const std::byte> body);

    /// Undoes the last write() with a body: nothing may have been written since.
    void take_back();

    /// Bytes of the chunk that is open; 0: none.
    std::uint64_t chunk_size() const { return chunk_open_ ? records_size() : 0; }

    /// Afterwards all before it is there for any reader.
    Expected<> end_chunk();

    /// Between chunks.
    Expected<> attach(const std::string& name, const std::string& media_type,
                      const std::string& content, std::int64_t time_ns);
    Expected<> add_metadata(const std::string& name,
                            const std::map<std::string, std::string>& values);

    /// Ends chunk and file.
    Expected<> close();

    /// After an error: gives up the chunk that is open, and ends the file before it.
    Expected<> close_before_chunk();

    const std::string& path() const { return path_; }
    int descriptor() const { return file_.get(); }
    std::uint64_t size() const { return offset_ + pending_.size(); }

 private:
    struct Mark {
        std::uint64_t offset = 0;
        std::uint32_t crc = 0;
        std::uint16_t channel = 0;
        std::uint64_t first_time = 0;
        std::uint64_t last_time = 0;
    };

    McapWriter(std::string path, FileDescriptor file);
    void begin_chunk();
    void begin_message(const MessageHead& message, std::uint64_t length);
    std::uint64_t records_size() const;
    Expected<> flush(std::span<const std::byte> body = {});
    Expected<> write_at(std::uint64_t offset, const std::string& bytes) const;
    Expected<> end_file();
    std::string chunk_head(std::uint64_t records) const;
    Expected<> reserve(std::uint64_t size);
    bool set_aside(std::uint64_t size);
    void sum();

    std::string path_;
    FileDescriptor file_;
    std::uint64_t offset_ = 0;    ///< what is written ends here
    std::uint64_t reserved_ = 0;  ///< and what the disk keeps free for it, here
    std::uint64_t ahead_;         ///< so much more is asked of the disk at a time
    std::string pending_;         ///< follows it
    std::size_t summed_ = 0;      ///< bytes of it that the chunk's checksum has
    McapSummary summary_;
    std::uint64_t summary_room_;  ///< bytes that it takes, and a little more
    std::uint16_t channels_ = 0;

    bool chunk_open_ = false;
    std::uint64_t chunk_begin_ = 0;
    std::uint32_t crc_ = 0;
    std::uint64_t first_time_ = 0;
    std::uint64_t last_time_ = 0;
    std::set<std::uint16_t> announced_;  ///< channels in this chunk
    std::map<std::uint16_t, std::vector<MessagePlace>> places_;
    Mark mark_;
};

}  // namespace versavis::client
