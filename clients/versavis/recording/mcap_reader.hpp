// SPDX-License-Identifier: BSD-3-Clause
// Reads the records of an MCAP file, which may be cut off, damaged or hostile.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

enum class McapOpcode : std::uint8_t {
    header = 0x01,
    footer = 0x02,
    schema = 0x03,
    channel = 0x04,
    message = 0x05,
    chunk = 0x06,
    message_index = 0x07,
    chunk_index = 0x08,
    attachment = 0x09,
    attachment_index = 0x0A,
    statistics = 0x0B,
    metadata = 0x0C,
    metadata_index = 0x0D,
    summary_offset = 0x0E,
    data_end = 0x0F,
};

struct McapRecord {
    McapOpcode opcode;
    std::uint64_t offset;                ///< of its first byte, the opcode, in the file
    std::uint64_t length;                ///< of its content
    std::span<const std::byte> content;  ///< all of it, or its beginning: see glance()

    std::uint64_t content_offset() const { return offset + 9; }
    std::uint64_t end() const { return content_offset() + length; }
};

/// Where a chunk lies. The records are bytes of the file unless there is a compression.
struct McapChunk {
    std::uint64_t offset;  ///< of its opcode
    std::uint64_t records_offset;
    std::uint64_t records_size;  ///< in the file
    std::uint32_t crc;           ///< of the records; 0: not given
    std::string compression;     ///< "", lz4 or zstd
    std::uint64_t unpacked = 0;  ///< size of the records

    std::uint64_t end() const { return records_offset + records_size; }
};

/// What cannot be read, and is passed over.
struct McapDamage {
    std::uint64_t offset;
    std::string what;  ///< with the place
};

struct McapSchema {
    std::string name;
    std::string encoding;
    std::string data;
};

struct McapChannel {
    std::uint16_t id;
    std::uint16_t schema;
    std::string topic;
    std::string encoding;
    std::map<std::string, std::string> metadata;
};

struct McapAttachment {
    std::string name;
    std::string media_type;
    std::string content;
};

struct McapMetadata {
    std::string name;
    std::map<std::string, std::string> values;
};

struct McapStatistics {
    std::uint64_t messages;
    std::uint64_t start_time;  ///< log times
    std::uint64_t end_time;
    std::map<std::uint16_t, std::uint64_t> of_channel;
};

/// The content of a message record.
struct McapMessage {
    std::uint16_t channel;
    std::uint32_t sequence;
    std::uint64_t log_time;
    std::uint64_t publish_time;
    std::span<const std::byte> data;
};

/// Bytes of a message record before its data.
inline constexpr std::size_t mcap_message_header = 22;

/// None: damaged.
std::optional<McapMessage> parse_message(std::span<const std::byte> content);
std::optional<McapChannel> parse_channel(std::span<const std::byte> content);

/// Memory that is used again for each chunk.
class McapBuffer {
 public:
    /// None: there is not so much memory.
    std::optional<std::span<std::byte>> take(std::uint64_t size);

 private:
    std::unique_ptr<std::byte[]> bytes_;
    std::uint64_t capacity_ = 0;
};

/// Nothing is allocated by a number of the file that is larger than the file. All errors name the
/// file and the byte. Thread-safe.
class McapReader {
 public:
    /// Returns whether to go on.
    using Visit = std::function<Expected<bool>(const McapRecord&)>;

    /// Finds the parts of the file: by its summary, or record by record when there is none, or a
    /// damaged one. Errors: it cannot be read, is no MCAP file, or its first record is damaged.
    static Expected<McapReader> open(const std::string& path);

    const std::string& path() const { return path_; }
    const std::string& profile() const { return profile_; }
    const std::string& library() const { return library_; }
    std::uint64_t size() const { return size_; }

    /// Why the summary is not used; empty: it is.
    const std::string& defect() const { return defect_; }

    /// Of a file with a defect: behind the last record that is whole.
    std::uint64_t good_end() const { return good_end_; }

    /// Places among what is whole that are not. Chunks are not looked into.
    const std::vector<McapDamage>& damages() const { return damages_; }

    /// Schemas, channels and messages outside of chunks, of a file with a defect.
    const std::vector<std::uint64_t>& loose() const { return loose_; }

    /// The record at such a place, whole.
    Expected<McapRecord> loose_record(std::uint64_t offset, std::vector<std::byte>& content) const;

    const std::vector<McapChunk>& chunks() const { return chunks_; }

    /// Of a file with a summary; else they are met in the chunks.
    const std::vector<McapChannel>& channels() const { return channels_; }
    const std::map<std::uint16_t, McapSchema>& schemas() const { return schemas_; }
    const std::optional<McapStatistics>& statistics() const { return statistics_; }

    const std::vector<McapMetadata>& metadata() const { return metadata_; }

    /// One that is larger than 64 MiB has no content here.
    const std::vector<McapAttachment>& attachments() const { return attachments_; }

    /// Error: its compression is not known, or it is too large.
    Expected<> check_readable(const McapChunk& chunk) const;

    /// Reads a chunk's records and checks them against their CRC. What is returned lies in
    /// `buffer`.
    Expected<std::span<const std::byte>> load(const McapChunk& chunk, McapBuffer& buffer) const;

    /// Calls `visit` with each record among `records`, which load() gave.
    Expected<> for_each(const McapChunk& chunk, std::span<const std::byte> records,
                        const Visit& visit) const;

    /// The same without reading more of each record than the first 64 KiB, and without the CRC.
    Expected<> glance(const McapChunk& chunk, const Visit& visit) const;

    /// Calls `visit` with each record outside of chunks, and each chunk, up to good_end().
    Expected<> top_level(const Visit& visit) const;

    /// Reads `into.size()` bytes. Error: the file has no such place, or the disk fails.
    Expected<> read(std::uint64_t offset, std::span<std::byte> into) const;

    Unexpected<Error> damaged(std::uint64_t offset, const std::string& what) const;

 private:
    class Window;

    McapReader(std::string path, FileDescriptor file, std::uint64_t size);
    Expected<> read_header();
    Expected<> read_summary();
    Expected<> check_summary(std::uint64_t begin, std::uint64_t end, std::uint32_t crc) const;
    Expected<> take_summary(std::uint64_t begin, std::uint64_t end);
    Expected<> take_summary_record(Window& window, const McapRecord& record);
    void scan();
    bool take_record(Window& window, const McapRecord& record);
    bool is_plausible(Window& window, const McapRecord& record) const;
    std::uint64_t next_record(Window& window, std::uint64_t from) const;
    void skip(const Error& damage, std::uint64_t offset);
    bool is_followed(Window& window, std::uint64_t at) const;
    bool has_attachment(const McapRecord& record) const;
    void drop_damaged_end();
    Expected<std::span<const std::byte>> unpack(const McapChunk& chunk, McapBuffer& buffer) const;
    Expected<McapChunk> chunk_at(Window& window, std::uint64_t offset) const;
    Expected<> claim(std::uint64_t begin, std::uint64_t end);
    Expected<> add_attachment(Window& window, std::uint64_t offset);
    Expected<> add_metadata(Window& window, std::uint64_t offset);
    Expected<std::vector<std::byte>> content_of(const McapRecord& record) const;
    void forget();

    std::string path_;
    FileDescriptor file_;
    std::uint64_t size_;
    std::string profile_;
    std::string library_;
    std::string defect_;
    std::uint64_t data_begin_ = 0;
    std::uint64_t good_end_ = 0;
    std::map<std::uint64_t, std::uint64_t> claimed_;  ///< of what was found: begin and end
    std::vector<McapDamage> damages_;
    std::vector<std::uint64_t> loose_;
    std::vector<McapChunk> chunks_;
    std::vector<McapChannel> channels_;
    std::map<std::uint16_t, McapSchema> schemas_;
    std::optional<McapStatistics> statistics_;
    std::vector<McapMetadata> metadata_;
    std::vector<McapAttachment> attachments_;
};

}  // namespace versavis::client
