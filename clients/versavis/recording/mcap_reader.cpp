// SPDX-License-Identifier: BSD-3-Clause
#include "recording/mcap_reader.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <lz4frame.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

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

/// A chunk that claims to hold more than so many times its size is none. zstd does 20 or so.
constexpr std::uint64_t unpacked_limit = 1 << 15U;

std::string reason(int error) { return std::error_code(error, std::generic_category()).message(); }

std::uint32_t crc_read(std::uint32_t crc, std::span<const std::byte> bytes) {
    return static_cast<std::uint32_t>(
        crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

bool can_unpack(const std::string& compression) {
    return compression.empty() || compression == "lz4" || compression == "zstd";
}

/// False: damaged, or of another size than `records`.
bool unpack_lz4(std::span<const std::byte> packed, std::span<std::byte> records) {
    LZ4F_dctx* context = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) return false;
    std::size_t done = 0;
    std::size_t hint = 1;
    while (hint != 0 && !packed.empty()) {
        std::size_t into = records.size() - done;
        std::size_t from = packed.size();
        hint =
            LZ4F_decompress(context, records.data() + done, &into, packed.data(), &from, nullptr);
        if (LZ4F_isError(hint) != 0 || (into == 0 && from == 0)) break;
        done += into;
        packed = packed.subspan(from);
    }
    LZ4F_freeDecompressionContext(context);
    return hint == 0 && done == records.size();
}

bool unpack_zstd(std::span<const std::byte> packed, std::span<std::byte> records) {
    return ZSTD_decompress(records.data(), records.size(), packed.data(), packed.size()) ==
           records.size();
}

/// Where the data end the summary begins, and it is made anew.
bool ends_data(McapOpcode opcode) {
    switch (opcode) {
        case McapOpcode::data_end:
        case McapOpcode::footer:
        case McapOpcode::statistics:
        case McapOpcode::chunk_index:
        case McapOpcode::attachment_index:
        case McapOpcode::metadata_index:
        case McapOpcode::summary_offset: return true;
        default: return false;
    }
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
    } else if (!reader.damages_.empty()) {
        // It may point beside what is there.
        const auto channels = std::move(reader.channels_);
        const auto schemas = std::move(reader.schemas_);
        reader.forget();
        reader.channels_ = channels;
        reader.schemas_ = schemas;
        reader.defect_ = "what its summary points to is damaged";
        reader.good_end_ = reader.data_begin_;
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
            if (!chunk) {
                skip(chunk.error(), offset);
                return {};
            }
            if (auto claimed = claim(offset, chunk->end()); !claimed) return claimed;
            chunks_.push_back(std::move(*chunk));
            break;
        }
        case McapOpcode::attachment_index:
        case McapOpcode::metadata_index: {
            const bool attachment = record.opcode == McapOpcode::attachment_index;
            const auto offset = cursor.number<std::uint64_t>();
            const auto length = cursor.number<std::uint64_t>();
            if (!cursor.good() || offset > size_ || length > size_ - offset)
                return damaged(record.offset, "an index points beyond the file");
            if (auto claimed = claim(offset, offset + std::max<std::uint64_t>(length, 1)); !claimed)
                return claimed;
            const auto added =
                attachment ? add_attachment(window, offset) : add_metadata(window, offset);
            if (!added) skip(added.error(), offset);
            return {};
        }
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

void McapReader::skip(const Error& damage, std::uint64_t offset) {
    damages_.push_back({offset, damage.what});
}

void McapReader::forget() {
    claimed_.clear();
    damages_.clear();
    chunks_.clear();
    channels_.clear();
    schemas_.clear();
    statistics_.reset();
    metadata_.clear();
    attachments_.clear();
}

/// From record to record; from one that is damaged to the next one that is whole.
void McapReader::scan() {
    Window window(*this, size_, glance_size);
    std::optional<std::uint64_t> index;  // the last record, if it is one: it may be cut short, too
    for (std::uint64_t at = data_begin_; at < size_;) {
        const auto record = window.record(at);
        if (record && ends_data(record->opcode) && is_plausible(window, *record)) break;
        if (record && is_plausible(window, *record) && take_record(window, *record)) {
            index.reset();
            if (record->opcode == McapOpcode::message_index) index = at;
            at = good_end_ = record->end();
            continue;
        }
        if (index) at = *std::exchange(index, std::nullopt);
        const std::uint64_t next = next_record(window, at + 1);
        if (next >= size_) break;
        damages_.push_back(
            {at, fmt::format("damaged at byte {}: {} bytes cannot be read", at, next - at)});
        at = next;
    }
    drop_damaged_end();
}

/// What a record of its kind must be, so that damage is not taken for one.
bool McapReader::is_plausible(Window& window, const McapRecord& record) const {
    const auto follows = [&] {
        if (record.end() == size_) return true;
        const auto next = window.at(record.end(), 1);
        if (!next || next->empty()) return false;
        const auto opcode = static_cast<std::uint8_t>((*next)[0]);
        return opcode >= static_cast<std::uint8_t>(McapOpcode::header) &&
               opcode <= static_cast<std::uint8_t>(McapOpcode::data_end);
    };
    ByteCursor cursor(record.content);
    // Of one that is larger only the beginning is looked at.
    const auto ends_there = [&](const ByteCursor& read) {
        return record.length > record.content.size() || (read.good() && read.left() == 0);
    };
    switch (record.opcode) {
        case McapOpcode::chunk:
        case McapOpcode::attachment: return true;  // they are checked when they are taken
        case McapOpcode::metadata:
            cursor.text();
            text_map(cursor);
            return ends_there(cursor) && follows();
        case McapOpcode::schema:
            cursor.number<std::uint16_t>();
            for (int text = 0; text < 3; ++text) cursor.text();
            return ends_there(cursor) && follows();
        case McapOpcode::channel:
            cursor.number<std::uint32_t>();  // its own number, and that of its schema
            for (int text = 0; text < 2; ++text) cursor.text();
            text_map(cursor);
            return ends_there(cursor) && follows();
        case McapOpcode::message: return record.length >= mcap_message_header && follows();
        case McapOpcode::message_index: {
            cursor.number<std::uint16_t>();
            const auto size = cursor.number<std::uint32_t>();
            return cursor.good() && size % 16 == 0 && size + 6U == record.length;
        }
        case McapOpcode::data_end: return record.length == 4;
        default: return ends_data(record.opcode) && follows();
    }
}

/// The first from there on that is a chunk, attachment, or another one that is whole; size(): none.
std::uint64_t McapReader::next_record(Window& window, std::uint64_t from) const {
    for (std::uint64_t at = from; at < size_;) {
        const auto bytes = window.at(at, glance_size);
        if (!bytes || bytes->empty()) return size_;
        const std::vector<std::byte> block(bytes->begin(), bytes->end());
        for (std::size_t i = 0; i < block.size(); ++i) {
            const auto opcode = static_cast<McapOpcode>(block[i]);
            const bool chunked = opcode == McapOpcode::chunk || opcode == McapOpcode::attachment;
            const bool alone = opcode == McapOpcode::schema || opcode == McapOpcode::channel ||
                               opcode == McapOpcode::message;
            // What lies in a damaged chunk has no checksum that holds: it is not looked for.
            if (!chunked && !(alone && chunks_.empty() && !loose_.empty())) continue;
            const auto record = window.record(at + i);
            if (!record || record->opcode != opcode) continue;
            if (opcode == McapOpcode::chunk) {
                if (chunk_at(window, at + i)) return at + i;
            } else if (record->length < content_limit && is_plausible(window, *record) &&
                       (opcode != McapOpcode::attachment || has_attachment(*record))) {
                return at + i;
            }
        }
        at += block.size();
    }
    return size_;
}

/// False: here begins what cannot be read.
bool McapReader::take_record(Window& window, const McapRecord& record) {
    switch (record.opcode) {
        case McapOpcode::chunk: {
            auto chunk = chunk_at(window, record.offset);
            if (!chunk) return false;
            // Where bytes of it are missing, it reaches into what follows.
            McapBuffer buffer;
            if (!is_followed(window, chunk->end()) && !load(*chunk, buffer)) return false;
            chunks_.push_back(std::move(*chunk));
            return true;
        }
        case McapOpcode::attachment:
            if (!is_followed(window, record.end()) && !has_attachment(record)) return false;
            return add_attachment(window, record.offset).has_value();
        case McapOpcode::metadata: return add_metadata(window, record.offset).has_value();
        case McapOpcode::schema:
        case McapOpcode::channel:
        case McapOpcode::message: loose_.push_back(record.offset); return true;
        case McapOpcode::message_index: return true;
        default: return false;
    }
}

bool McapReader::is_followed(Window& window, std::uint64_t at) const {
    if (at == size_) return true;
    const auto next = window.record(at);
    if (!next || !is_plausible(window, *next)) return false;
    return next->opcode != McapOpcode::chunk || chunk_at(window, at).has_value();
}

bool McapReader::has_attachment(const McapRecord& record) const {
    const auto content = content_of(record);
    if (!content || content->size() < 32) return false;
    std::uint32_t crc = 0;
    std::memcpy(&crc, content->data() + content->size() - 4, sizeof crc);
    return crc != 0 &&
           crc_read(crc_read(0, {}), std::span(*content).first(content->size() - 4)) == crc;
}

Expected<McapRecord> McapReader::loose_record(std::uint64_t offset,
                                              std::vector<std::byte>& content) const {
    Window window(*this, size_, glance_size);
    auto record = window.record(offset);
    if (!record) return record;
    content.resize(record->length);
    if (auto got = read(record->content_offset(), content); !got) return Unexpected(got.error());
    record->content = content;
    return record;
}

/// After a loss of power the last chunks may be there by their length only.
void McapReader::drop_damaged_end() {
    McapBuffer buffer;
    std::size_t dropped = 0;
    while (!chunks_.empty()) {
        const McapChunk& last = chunks_.back();
        if (!can_unpack(last.compression)) break;
        const auto records = load(last, buffer);
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
    McapChunk chunk{};
    chunk.unpacked = cursor.number<std::uint64_t>();
    chunk.offset = offset;
    chunk.crc = cursor.number<std::uint32_t>();
    chunk.compression = cursor.text();
    chunk.records_size = cursor.number<std::uint64_t>();
    chunk.records_offset = record->content_offset() + cursor.at();
    const bool fits = cursor.good() && cursor.at() <= record->length &&
                      chunk.records_size == record->length - cursor.at();
    if (record->opcode != McapOpcode::chunk || !fits ||
        (chunk.compression.empty() && chunk.unpacked != chunk.records_size))
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
    if (!can_unpack(chunk.compression))
        return failure(
            path_,
            fmt::format("the chunk at byte {} is compressed ({})", chunk.offset, chunk.compression),
            "decompress it first, with 'mcap decompress' for example");
    if (chunk.records_size > chunk_limit || chunk.unpacked > chunk_limit ||
        chunk.unpacked / unpacked_limit > chunk.records_size)
        return failure(path_, fmt::format("the chunk at byte {} has {} MiB, more than can be read",
                                          chunk.offset, chunk.unpacked >> 20U));
    return {};
}

Expected<std::span<const std::byte>> McapReader::unpack(const McapChunk& chunk,
                                                        McapBuffer& buffer) const {
    McapBuffer packed_buffer;
    const auto packed = packed_buffer.take(chunk.records_size);
    const auto records = buffer.take(chunk.unpacked);
    if (!packed || !records)
        return failure(path_, fmt::format("the chunk at byte {} needs {} MiB of memory",
                                          chunk.offset, chunk.unpacked >> 20U));
    if (auto got = read(chunk.records_offset, *packed); !got) return Unexpected(got.error());
    const bool good =
        chunk.compression == "lz4" ? unpack_lz4(*packed, *records) : unpack_zstd(*packed, *records);
    if (!good) return damaged(chunk.offset, "the chunk cannot be unpacked");
    return std::span<const std::byte>(*records);
}

Expected<std::span<const std::byte>> McapReader::load(const McapChunk& chunk,
                                                      McapBuffer& buffer) const {
    if (auto readable = check_readable(chunk); !readable) return Unexpected(readable.error());
    std::span<const std::byte> records;
    if (!chunk.compression.empty()) {
        auto unpacked = unpack(chunk, buffer);
        if (!unpacked) return unpacked;
        records = *unpacked;
    } else {
        const auto taken = buffer.take(chunk.records_size);
        if (!taken)
            return failure(path_, fmt::format("the chunk at byte {} needs {} MiB of memory",
                                              chunk.offset, chunk.records_size >> 20U));
        if (auto got = read(chunk.records_offset, *taken); !got) return Unexpected(got.error());
        records = *taken;
    }
    if (chunk.crc != 0 && crc_read(crc_read(0, {}), records) != chunk.crc)
        return damaged(chunk.offset, "the chunk differs from its checksum");
    return records;
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
    if (!chunk.compression.empty()) {
        McapBuffer buffer;
        const auto records = load(chunk, buffer);
        if (!records) return Unexpected(records.error());
        return for_each(chunk, *records, visit);
    }
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
