// SPDX-License-Identifier: BSD-3-Clause
#include "recording/mcap_reader.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <new>
#include <system_error>
#include <utility>

#include "base/byte_cursor.hpp"

namespace versavis::client {

namespace {

constexpr std::array<unsigned char, 8> magic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
constexpr std::uint64_t record_header = 9;  ///< opcode and length
constexpr std::uint64_t footer_length = 20;
constexpr std::uint64_t footer_record = record_header + footer_length;

/// How much of a record is looked at where its content is not wanted. An image begins with less
/// than 1 KiB, status documents have some 20 KiB.
constexpr std::uint64_t glance_size = 64 << 10U;

/// Enough of a chunk to see where its records lie. Twice as much reads no more of a disk.
constexpr std::uint64_t chunk_header_size = 256;

/// Records that are kept. Attachments are configurations and lists of features, of some 100 KiB.
constexpr std::uint64_t content_limit = 64 << 20U;

/// Places in a chunk are 32 bits: one frame and 4 MiB, as ours have, are far less. Twice as much
/// would not fit into them.
constexpr std::uint64_t chunk_limit = 0xFFFFFFFF;

std::string reason(int error) { return std::error_code(error, std::generic_category()).message(); }

std::uint32_t crc_read(std::uint32_t crc, std::span<const std::byte> bytes) {
    return static_cast<std::uint32_t>(
        crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::map<std::string, std::string> text_map(ByteCursor& cursor) {
    ByteCursor entries(cursor.bytes(cursor.number<std::uint32_t>()));
    std::map<std::string, std::string> map;
    while (entries.good() && entries.left() > 0) {
        const std::string key(entries.text());
        const std::string_view value = entries.text();
        if (entries.good()) map.insert_or_assign(key, std::string(value));
    }
    if (!entries.good()) cursor.bytes(~std::uint64_t{0});  // what is damaged inside is damaged
    return map;
}

}  // namespace

std::optional<McapMessage> parse_message(std::span<const std::byte> content) {
    ByteCursor cursor(content);
    McapMessage message{};
    message.channel = cursor.number<std::uint16_t>();
    message.sequence = cursor.number<std::uint32_t>();
    message.log_time = cursor.number<std::uint64_t>();
    message.publish_time = cursor.number<std::uint64_t>();
    message.data = cursor.bytes(cursor.left());
    if (!cursor.good()) return std::nullopt;
    return message;
}

std::optional<McapChannel> parse_channel(std::span<const std::byte> content) {
    ByteCursor cursor(content);
    McapChannel channel{};
    channel.id = cursor.number<std::uint16_t>();
    channel.schema = cursor.number<std::uint16_t>();
    channel.topic = cursor.text();
    channel.encoding = cursor.text();
    channel.metadata = text_map(cursor);
    if (!cursor.good()) return std::nullopt;
    return channel;
}

std::optional<std::span<std::byte>> McapBuffer::take(std::uint64_t size) {
    if (size > capacity_) {
        bytes_.reset();
        bytes_.reset(new (std::nothrow) std::byte[size]);
        capacity_ = bytes_ ? size : 0;
        if (!bytes_) return std::nullopt;
    }
    return std::span(bytes_.get(), size);
}

/// A piece of the file, so that many small records take few reads.
class McapReader::Window {
 public:
    Window(const McapReader& reader, std::uint64_t end, std::uint64_t size)
        : reader_(reader), end_(end), buffer_(size) {}

    /// `count` bytes; fewer only before the end, or where they are more than the window holds.
    Expected<std::span<const std::byte>> at(std::uint64_t offset, std::uint64_t count) {
        count = std::min({count, end_ - std::min(offset, end_), std::uint64_t{buffer_.size()}});
        if (offset < begin_ || offset + count > begin_ + filled_) {
            begin_ = offset;
            filled_ = std::min<std::uint64_t>(buffer_.size(), end_ - std::min(offset, end_));
            if (auto read = reader_.read(begin_, std::span(buffer_).first(filled_)); !read) {
                filled_ = 0;
                return Unexpected(read.error());
            }
        }
        return std::span<const std::byte>(buffer_).subspan(offset - begin_, count);
    }

    /// The record that begins there, with the beginning of its content. Error: not wholly there.
    Expected<McapRecord> record(std::uint64_t offset) {
        auto header = at(offset, record_header);
        if (!header) return Unexpected(header.error());
        if (header->size() < record_header) return reader_.damaged(offset, "a record is cut off");
        ByteCursor cursor(*header);
        McapRecord record{};
        record.opcode = static_cast<McapOpcode>(cursor.number<std::uint8_t>());
        record.offset = offset;
        record.length = cursor.number<std::uint64_t>();
        if (record.length > end_ - record.content_offset())
            return reader_.damaged(offset, "a record is longer than what follows");
        auto content = at(record.content_offset(), record.length);
        if (!content) return Unexpected(content.error());
        record.content = *content;
        return record;
    }

 private:
    const McapReader& reader_;
    std::uint64_t end_;
    std::uint64_t begin_ = 0;
    std::uint64_t filled_ = 0;
    std::vector<std::byte> buffer_;
};

McapReader::McapReader(std::string path, FileDescriptor file, std::uint64_t size)
    : path_(std::move(path)), file_(std::move(file)), size_(size) {}

Expected<McapReader> McapReader::open(const std::string& path) {
    FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    if (!file) return failure(path, "cannot be read: " + reason(errno));
    struct stat facts {};
    const bool regular = ::fstat(file.get(), &facts) == 0 && S_ISREG(facts.st_mode);
    if (!regular) return failure(path, "is not a file", "name a recording");
    McapReader reader(path, std::move(file), static_cast<std::uint64_t>(facts.st_size));
    if (auto begun = reader.read_header(); !begun) return Unexpected(begun.error());
    if (auto read = reader.read_summary(); !read) {
        reader.defect_ = read.error().what;
        reader.scan();
    }
    reader.claimed_.clear();
    return reader;
}

Unexpected<Error> McapReader::damaged(std::uint64_t offset, const std::string& what) const {
    return failure(path_, fmt::format("damaged at byte {}: {}", offset, what));
}

Expected<> McapReader::read(std::uint64_t offset, std::span<std::byte> into) const {
    if (offset > size_ || into.size() > size_ - offset)
        return damaged(offset, "the file ends before that");
    while (!into.empty()) {
        const ssize_t got =
            ::pread(file_.get(), into.data(), into.size(), static_cast<off_t>(offset));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0)
            return failure(path_,
                           fmt::format("cannot be read at byte {}: {}", offset, reason(errno)));
        if (got == 0) return damaged(offset, "the file became shorter while it was read");
        into = into.subspan(static_cast<std::size_t>(got));
        offset += static_cast<std::uint64_t>(got);
    }
    return {};
}

Expected<> McapReader::read_header() {
    std::array<std::byte, magic.size()> begin{};
    if (size_ < begin.size()) return failure(path_, "is no MCAP file: it is too short");
    if (auto got = read(0, begin); !got) return Unexpected(got.error());
    if (std::memcmp(begin.data(), magic.data(), magic.size()) != 0)
        return failure(path_, "is no MCAP file", "name a file that 'versavis record' wrote");
    Window window(*this, size_, glance_size);
    const auto header = window.record(magic.size());
    if (!header) return Unexpected(header.error());
    ByteCursor cursor(header->content);
    profile_ = cursor.text();
    library_ = cursor.text();
    if (header->opcode != McapOpcode::header || !cursor.good())
        return damaged(magic.size(), "the header is not whole");
    data_begin_ = header->end();
    good_end_ = data_begin_;
    return {};
}

Expected<> McapReader::read_summary() {
    constexpr std::uint64_t tail = footer_record + magic.size();
    std::array<std::byte, tail> end{};
    if (size_ < data_begin_ + tail) return failure({}, "it was cut off");
    const std::uint64_t footer = size_ - tail;
    if (auto got = read(footer, end); !got) return Unexpected(got.error());
    if (std::memcmp(end.data() + footer_record, magic.data(), magic.size()) != 0)
        return failure({}, "it was cut off");
    ByteCursor cursor(end);
    const auto opcode = static_cast<McapOpcode>(cursor.number<std::uint8_t>());
    const auto length = cursor.number<std::uint64_t>();
    const auto begin = cursor.number<std::uint64_t>();
    const auto offsets = cursor.number<std::uint64_t>();
    const auto crc = cursor.number<std::uint32_t>();
    if (opcode != McapOpcode::footer || length != footer_length)
        return failure({}, "its footer is damaged");
    if (begin == 0) return failure({}, "it has no summary");
    if (begin < data_begin_ || begin > footer || (offsets != 0 && offsets > footer))
        return failure({}, "its footer points beyond its end");
    if (auto checked = check_summary(begin, footer, crc); !checked) return checked;
    if (auto taken = take_summary(begin, footer); !taken) {
        forget();
        return failure({}, "its summary is " + taken.error().what);
    }
    std::sort(chunks_.begin(), chunks_.end(),
              [](const McapChunk& a, const McapChunk& b) { return a.offset < b.offset; });
    good_end_ = size_;
    return {};
}

Expected<> McapReader::take_summary(std::uint64_t begin, std::uint64_t end) {
    Window summary(*this, end, glance_size);
    Window places(*this, size_, chunk_header_size);
    for (std::uint64_t at = begin; at < end;) {
        const auto record = summary.record(at);
        if (!record) return Unexpected(record.error());
        at = record->end();
        if (auto taken = take_summary_record(places, *record); !taken) return taken;
    }
    return {};
}

Expected<> McapReader::check_summary(std::uint64_t begin, std::uint64_t end,
                                     std::uint32_t crc) const {
    if (crc == 0) return {};
    constexpr std::uint64_t until_crc = footer_record - 4;
    std::vector<std::byte> block(glance_size);
    std::uint32_t sum = crc_read(0, {});
    for (std::uint64_t at = begin; at < end + until_crc;) {
        const auto part =
            std::span(block).first(std::min<std::uint64_t>(block.size(), end + until_crc - at));
        if (auto got = read(at, part); !got) return got;
        sum = crc_read(sum, part);
        at += part.size();
    }
    if (sum != crc) return failure({}, "its summary is damaged");
    return {};
}

Expected<> McapReader::take_summary_record(Window& window, const McapRecord& record) {
    auto content = content_of(record);
    if (!content) return Unexpected(content.error());
    ByteCursor cursor(*content);
    switch (record.opcode) {
        case McapOpcode::schema: {
            const auto id = cursor.number<std::uint16_t>();
            McapSchema schema{std::string(cursor.text()), std::string(cursor.text()), {}};
            schema.data = as_text(cursor.bytes(cursor.number<std::uint32_t>()));
            schemas_.insert_or_assign(id, std::move(schema));
            break;
        }
        case McapOpcode::channel: {
            auto channel = parse_channel(*content);
            if (!channel) return damaged(record.offset, "a channel");
            channels_.push_back(std::move(*channel));
            return {};
        }
        case McapOpcode::statistics: {
            McapStatistics statistics{};
            statistics.messages = cursor.number<std::uint64_t>();
            cursor.bytes(2 + 4 * 4);
            statistics.start_time = cursor.number<std::uint64_t>();
            statistics.end_time = cursor.number<std::uint64_t>();
            ByteCursor counts(cursor.bytes(cursor.number<std::uint32_t>()));
            while (counts.left() > 0 && counts.good()) {
                const auto channel = counts.number<std::uint16_t>();
                statistics.of_channel[channel] = counts.number<std::uint64_t>();
            }
            if (!counts.good()) return damaged(record.offset, "statistics");
            statistics_ = std::move(statistics);
            break;
        }
        case McapOpcode::chunk_index: {
            cursor.bytes(16);
            const auto offset = cursor.number<std::uint64_t>();
            if (!cursor.good() || offset < data_begin_)
                return damaged(record.offset, "an index of a chunk");
            auto chunk = chunk_at(window, offset);
            if (!chunk) return Unexpected(chunk.error());
            if (auto claimed = claim(offset, chunk->end()); !claimed) return claimed;
            chunks_.push_back(std::move(*chunk));
            break;
        }
        case McapOpcode::attachment_index:
            return add_attachment(window, cursor.number<std::uint64_t>());
        case McapOpcode::metadata_index:
            return add_metadata(window, cursor.number<std::uint64_t>());
        default: break;
    }
    return cursor.good() ? Expected<>() : damaged(record.offset, "a record is too short");
}

/// A summary that names a place twice, or one within another, would have a file take more memory
/// than it has bytes.
Expected<> McapReader::claim(std::uint64_t begin, std::uint64_t end) {
    const auto next = claimed_.lower_bound(begin);
    const bool into_next = next != claimed_.end() && next->first < end;
    const bool into_previous = next != claimed_.begin() && std::prev(next)->second > begin;
    if (into_next || into_previous) return damaged(begin, "two entries point to the same place");
    claimed_.emplace_hint(next, begin, end);
    return {};
}

void McapReader::forget() {
    claimed_.clear();
    chunks_.clear();
    channels_.clear();
    schemas_.clear();
    statistics_.reset();
    metadata_.clear();
    attachments_.clear();
}

void McapReader::scan() {
    Window window(*this, size_, glance_size);
    while (good_end_ < size_) {
        const auto record = window.record(good_end_);
        if (!record || !take_record(window, *record)) break;
        good_end_ = record->end();
    }
    drop_damaged_end();
}

/// False: here begins what cannot be read.
bool McapReader::take_record(Window& window, const McapRecord& record) {
    switch (record.opcode) {
        case McapOpcode::chunk: {
            auto chunk = chunk_at(window, record.offset);
            if (chunk) chunks_.push_back(std::move(*chunk));
            return chunk.has_value();
        }
        case McapOpcode::attachment: return add_attachment(window, record.offset).has_value();
        case McapOpcode::metadata: return add_metadata(window, record.offset).has_value();
        case McapOpcode::schema:
        case McapOpcode::channel:
        case McapOpcode::message:
        case McapOpcode::message_index: return true;
        default: return false;  // where the data end the summary begins, and it is made anew
    }
}

/// After a loss of power the last chunks may be there by their length only.
void McapReader::drop_damaged_end() {
    McapBuffer buffer;
    std::size_t dropped = 0;
    while (!chunks_.empty()) {
        const McapChunk& last = chunks_.back();
        const auto records = load(last, buffer);
        if (!last.compression.empty()) break;
        if (records && for_each(last, *records, [](const McapRecord&) { return true; })) break;
        good_end_ = last.offset;
        chunks_.pop_back();
        ++dropped;
    }
    if (dropped > 0) defect_ += fmt::format(", and the last {} chunks are damaged", dropped);
}

Expected<McapChunk> McapReader::chunk_at(Window& window, std::uint64_t offset) const {
    const auto record = window.record(offset);
    if (!record) return Unexpected(record.error());
    ByteCursor cursor(record->content);
    cursor.bytes(16);
    const auto uncompressed = cursor.number<std::uint64_t>();
    McapChunk chunk{};
    chunk.offset = offset;
    chunk.crc = cursor.number<std::uint32_t>();
    chunk.compression = cursor.text();
    chunk.records_size = cursor.number<std::uint64_t>();
    chunk.records_offset = record->content_offset() + cursor.at();
    const bool fits = cursor.good() && cursor.at() <= record->length &&
                      chunk.records_size == record->length - cursor.at();
    if (record->opcode != McapOpcode::chunk || !fits ||
        (chunk.compression.empty() && uncompressed != chunk.records_size))
        return damaged(offset, "a chunk's sizes contradict each other");
    return chunk;
}

Expected<std::vector<std::byte>> McapReader::content_of(const McapRecord& record) const {
    std::vector<std::byte> content(std::min(record.length, content_limit));
    if (auto got = read(record.content_offset(), content); !got) return Unexpected(got.error());
    return content;
}

Expected<> McapReader::add_attachment(Window& window, std::uint64_t offset) {
    const auto record = window.record(offset);
    if (!record) return Unexpected(record.error());
    if (record->opcode != McapOpcode::attachment)
        return damaged(offset, "no attachment, as the summary says");
    if (auto claimed = claim(offset, record->end()); !claimed) return claimed;
    auto content = content_of(*record);
    if (!content) return Unexpected(content.error());
    ByteCursor cursor(*content);
    cursor.bytes(16);
    McapAttachment attachment;
    attachment.name = cursor.text();
    attachment.media_type = cursor.text();
    const auto size = cursor.number<std::uint64_t>();
    if (!cursor.good()) return damaged(offset, "an attachment is not whole");
    if (content->size() < content_limit) {
        attachment.content = as_text(cursor.bytes(size));
        const std::size_t until = cursor.at();
        const auto crc = cursor.number<std::uint32_t>();
        const auto sum = crc_read(crc_read(0, {}), std::span(*content).first(until));
        if (!cursor.good() || (crc != 0 && crc != sum))
            return damaged(offset, "an attachment differs from its checksum");
    }
    attachments_.push_back(std::move(attachment));
    return {};
}

Expected<> McapReader::add_metadata(Window& window, std::uint64_t offset) {
    const auto record = window.record(offset);
    if (!record) return Unexpected(record.error());
    if (record->opcode != McapOpcode::metadata)
        return damaged(offset, "no metadata, as the summary says");
    if (auto claimed = claim(offset, record->end()); !claimed) return claimed;
    auto content = content_of(*record);
    if (!content) return Unexpected(content.error());
    ByteCursor cursor(*content);
    McapMetadata metadata;
    metadata.name = cursor.text();
    metadata.values = text_map(cursor);
    if (!cursor.good()) return damaged(offset, "a metadata record is not whole");
    metadata_.push_back(std::move(metadata));
    return {};
}

Expected<> McapReader::check_readable(const McapChunk& chunk) const {
    if (!chunk.compression.empty())
        return failure(
            path_,
            fmt::format("the chunk at byte {} is compressed ({})", chunk.offset, chunk.compression),
            "decompress it first, with 'mcap decompress' for example");
    if (chunk.records_size > chunk_limit)
        return failure(path_, fmt::format("the chunk at byte {} has {} MiB, more than can be read",
                                          chunk.offset, chunk.records_size >> 20U));
    return {};
}

Expected<std::span<const std::byte>> McapReader::load(const McapChunk& chunk,
                                                      McapBuffer& buffer) const {
    if (auto readable = check_readable(chunk); !readable) return Unexpected(readable.error());
    const auto records = buffer.take(chunk.records_size);
    if (!records)
        return failure(path_, fmt::format("the chunk at byte {} needs {} MiB of memory",
                                          chunk.offset, chunk.records_size >> 20U));
    if (auto got = read(chunk.records_offset, *records); !got) return Unexpected(got.error());
    if (chunk.crc != 0 && crc_read(crc_read(0, {}), *records) != chunk.crc)
        return damaged(chunk.offset, "the chunk differs from its checksum");
    return std::span<const std::byte>(*records);
}

Expected<> McapReader::for_each(const McapChunk& chunk, std::span<const std::byte> records,
                                const Visit& visit) const {
    ByteCursor cursor(records);
    while (cursor.left() > 0) {
        McapRecord record{};
        record.offset = chunk.records_offset + cursor.at();
        record.opcode = static_cast<McapOpcode>(cursor.number<std::uint8_t>());
        record.length = cursor.number<std::uint64_t>();
        record.content = cursor.bytes(record.length);
        if (!cursor.good())
            return damaged(record.offset, "a record is longer than the rest of its chunk");
        const auto more = visit(record);
        if (!more) return Unexpected(more.error());
        if (!*more) return {};
    }
    return {};
}

Expected<> McapReader::top_level(const Visit& visit) const {
    Window window(*this, good_end_, glance_size);
    for (std::uint64_t at = magic.size(); at < good_end_;) {
        const auto record = window.record(at);
        if (!record) return Unexpected(record.error());
        const auto more = visit(*record);
        if (!more) return Unexpected(more.error());
        if (!*more) return {};
        at = record->end();
    }
    return {};
}

Expected<> McapReader::glance(const McapChunk& chunk, const Visit& visit) const {
    if (auto readable = check_readable(chunk); !readable) return readable;
    Window window(*this, chunk.end(), glance_size);
    for (std::uint64_t at = chunk.records_offset; at < chunk.end();) {
        const auto record = window.record(at);
        if (!record) return Unexpected(record.error());
        const auto more = visit(*record);
        if (!more) return Unexpected(more.error());
        if (!*more) return {};
        at = record->end();
    }
    return {};
}

}  // namespace versavis::client
