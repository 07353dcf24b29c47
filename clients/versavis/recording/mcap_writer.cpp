// SPDX-License-Identifier: BSD-3-Clause
#include "recording/mcap_writer.hpp"

#include <fcntl.h>
#include <isa-l/crc.h>
#include <sys/file.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>

#include "recording/mcap_record.hpp"

namespace versavis::client {

namespace {

/// Bytes that the disk keeps free ahead of the file, so that it lies in few pieces.
constexpr std::uint64_t reserved_ahead = 64 << 20U;

/// Below that, a disk that is nearly full is asked for what is needed.
constexpr std::uint64_t least_ahead = 1 << 20U;

/// Of a chunk that is not ended: longer than any file, so that every reader finds it cut off.
constexpr std::uint64_t unended = std::uint64_t{1} << 50U;

constexpr std::uint64_t chunk_head_size = 49;

/// Room for the parts of a summary that do not grow; and for what each of the others has beside its
/// names, and each channel of a chunk.
constexpr std::uint64_t summary_base = 16 << 10U;
constexpr std::uint64_t summary_entry = 128;
constexpr std::uint64_t summary_place = 10;

std::uint32_t crc_of(std::uint32_t before, std::span<const std::byte> bytes) {
    // The library's argument is not const; it only reads.
    auto* data = reinterpret_cast<unsigned char*>(const_cast<std::byte*>(bytes.data()));
    return ::crc32_gzip_refl(before, data, bytes.size());
}

}  // namespace

std::string mcap_schema(std::uint16_t id, const McapTopic& topic) {
    return mcap_number(id) + mcap_text(topic.schema) + mcap_text(topic.schema_encoding) +
           mcap_text(topic.schema_text);
}

std::string mcap_channel(std::uint16_t id, std::uint16_t schema, const McapTopic& topic) {
    return mcap_number(id) + mcap_number(schema) + mcap_text(topic.name) +
           mcap_text(topic.encoding) + mcap_map(topic.metadata);
}

McapWriter::McapWriter(std::string path, FileDescriptor file)
    : path_(std::move(path)),
      file_(std::move(file)),
      ahead_(reserved_ahead),
      summary_room_(summary_base) {}

Expected<McapWriter> McapWriter::create(const std::string& path, const std::string& library,
                                        const std::string& profile) {
    auto file = create_file(path, O_RDWR);
    if (!file) return Unexpected(file.error());
    ::flock(file->get(), LOCK_EX | LOCK_NB);
    McapWriter writer(path, std::move(*file));
    writer.pending_ =
        mcap_magic + mcap_record(McapOpcode::header, mcap_text(profile) + mcap_text(library));
    if (auto written = writer.flush(); !written) {
        ::unlink(path.c_str());
        return Unexpected(written.error());
    }
    return writer;
}

std::uint16_t McapWriter::add(const McapTopic& topic) {
    const std::uint16_t id = ++channels_;
    summary_.schemas[id] = mcap_schema(id, topic);
    summary_.channels[id] = mcap_channel(id, id, topic);
    summary_room_ += summary_.schemas[id].size() + summary_.channels[id].size() + summary_entry;
    return id;
}

void McapWriter::write(const MessageHead& message, const std::string& data) {
    begin_message(message, data.size());
    pending_ += data;
}

Expected<> McapWriter::write(const MessageHead& message, const std::string& data,
                             std::span<const std::byte> body) {
    begin_message(message, data.size() + body.size());
    pending_ += data;
    return flush(body);
}

void McapWriter::begin_message(const MessageHead& message, std::uint64_t length) {
    if (!chunk_open_) begin_chunk();
    if (announced_.insert(message.channel).second)
        pending_ += mcap_record(McapOpcode::schema, summary_.schemas[message.channel]) +
                    mcap_record(McapOpcode::channel, summary_.channels[message.channel]);
    sum();
    mark_ = {size(), crc_, message.channel, first_time_, last_time_};
    const auto time = static_cast<std::uint64_t>(message.time_ns);
    first_time_ = std::min(first_time_, time);
    last_time_ = std::max(last_time_, time);
    places_[message.channel].push_back({time, records_size()});
    pending_ += mcap_record_head(McapOpcode::message, mcap_message_header + length) +
                mcap_number(message.channel) + mcap_number(message.sequence) + mcap_number(time) +
                mcap_number(message.publish_time.value_or(time));
}

void McapWriter::take_back() {
    offset_ = mark_.offset;
    crc_ = mark_.crc;
    first_time_ = mark_.first_time;
    last_time_ = mark_.last_time;
    // A crash after the next chunk must leave nothing behind it. Where that fails, what comes next
    // overwrites it all the same.
    if (::ftruncate(file_.get(), static_cast<off_t>(offset_)) == 0) reserved_ = offset_;
    auto& places = places_[mark_.channel];
    places.pop_back();
    if (places.empty()) places_.erase(mark_.channel);
}

void McapWriter::begin_chunk() {
    chunk_begin_ = size();
    pending_ += chunk_head(unended);
    summed_ = pending_.size();
    chunk_open_ = true;
    announced_.clear();
    crc_ = 0;
    first_time_ = std::numeric_limits<std::uint64_t>::max();
    last_time_ = 0;
}

std::uint64_t McapWriter::records_size() const { return size() - chunk_begin_ - chunk_head_size; }

std::string McapWriter::chunk_head(std::uint64_t records) const {
    return mcap_record_head(McapOpcode::chunk, chunk_head_size - 9 + records) +
           mcap_number(first_time_) + mcap_number(last_time_) + mcap_number(records) +
           mcap_number(crc_) + mcap_text("") + mcap_number(records);
}

/// The checksum of what is pending.
void McapWriter::sum() {
    crc_ = crc_of(crc_, std::as_bytes(std::span(pending_)).subspan(summed_));
    summed_ = pending_.size();
}

Expected<> McapWriter::end_chunk() {
    if (!chunk_open_) return {};
    if (auto written = flush(); !written) return written;
    if (places_.empty()) first_time_ = last_time_;  // all was taken back: nothing but channels
    SummaryChunk one{};
    one.start_time = first_time_;
    one.end_time = last_time_;
    one.offset = chunk_begin_;
    one.length = offset_ - chunk_begin_;
    one.records_size = records_size();
    for (const auto& [channel, places] : places_) {
        one.indexes[channel] = size();
        pending_ += message_index(channel, places);
    }
    one.indexes_length = pending_.size();
    // The indexes first: what follows a chunk that is whole is whole, too.
    summed_ = pending_.size();
    if (auto written = flush(); !written) return written;
    if (auto written = write_at(chunk_begin_, chunk_head(one.records_size)); !written)
        return written;
    for (const auto& [channel, places] : places_) summary_.messages[channel] += places.size();
    if (summary_.end_time == 0) summary_.start_time = first_time_;
    if (!places_.empty()) summary_.start_time = std::min(summary_.start_time, first_time_);
    summary_.end_time = std::max(summary_.end_time, last_time_);
    summary_room_ += summary_entry + summary_place * one.indexes.size();
    summary_.chunks.push_back(std::move(one));
    places_.clear();
    chunk_open_ = false;
    return {};
}

Expected<> McapWriter::attach(const std::string& name, const std::string& media_type,
                              const std::string& content, std::int64_t time_ns) {
    const auto time = static_cast<std::uint64_t>(time_ns);
    std::string record = mcap_number(time) + mcap_number(time) + mcap_text(name) +
                         mcap_text(media_type) + mcap_number(std::uint64_t{content.size()}) +
                         content;
    record += mcap_number(crc_of(0, std::as_bytes(std::span(record))));
    record = mcap_record(McapOpcode::attachment, record);
    summary_.attachments.push_back(
        {size(), record.size(), time, time, content.size(), name, media_type});
    summary_room_ += summary_entry + name.size() + media_type.size();
    pending_ += record;
    return flush();
}

Expected<> McapWriter::add_metadata(const std::string& name,
                                    const std::map<std::string, std::string>& values) {
    const std::string record =
        mcap_record(McapOpcode::metadata, mcap_text(name) + mcap_map(values));
    summary_.metadata.push_back({size(), record.size(), name});
    summary_room_ += summary_entry + name.size();
    pending_ += record;
    return flush();
}

Expected<> McapWriter::close() {
    if (auto ended = end_chunk(); !ended) return ended;
    return end_file();
}

Expected<> McapWriter::close_before_chunk() {
    pending_.clear();
    summed_ = 0;
    places_.clear();
    if (chunk_open_) offset_ = chunk_begin_;
    chunk_open_ = false;
    return end_file();
}

Expected<> McapWriter::end_file() {
    // What was kept free for the summary is given back when it is written, and the summary when it
    // is not.
    const std::uint64_t end = offset_;
    pending_ = mcap_end(summary_, offset_);
    summary_room_ = 0;
    auto written = flush();
    if (!written) {
        pending_.clear();
        offset_ = end;
    }
    if (::ftruncate(file_.get(), static_cast<off_t>(offset_)) != 0 && written)
        return not_written(path_);
    if (!written) return written;
    return sync_file(file_, path_);
}

Expected<> McapWriter::flush(std::span<const std::byte> body) {
    sum();
    if (auto room = reserve(pending_.size() + body.size()); !room) return room;
    iovec parts[]{{pending_.data(), pending_.size()},
                  {const_cast<std::byte*>(body.data()), body.size()}};
    for (std::size_t first = parts[0].iov_len > 0 ? 0 : 1; first < 2 && parts[first].iov_len > 0;) {
        const ssize_t written = ::pwritev(file_.get(), parts + first, static_cast<int>(2 - first),
                                          static_cast<off_t>(offset_));
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) return not_written(path_);
        offset_ += static_cast<std::uint64_t>(written);
        auto left = static_cast<std::size_t>(written);
        for (; first < 2; ++first) {
            const std::size_t taken = std::min(left, parts[first].iov_len);
            parts[first].iov_base = static_cast<std::byte*>(parts[first].iov_base) + taken;
            parts[first].iov_len -= taken;
            left -= taken;
            if (parts[first].iov_len > 0) break;
        }
    }
    crc_ = crc_of(crc_, body);
    pending_.clear();
    summed_ = 0;
    return {};
}

Expected<> McapWriter::write_at(std::uint64_t offset, const std::string& bytes) const {
    const ssize_t written =
        ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written == static_cast<ssize_t>(bytes.size())) return {};
    return not_written(path_, written < 0 ? errno : ENOSPC);
}

/// For the next `size` bytes, and the summary that follows: a disk that is full ends a recording
/// before there is no room for that.
Expected<> McapWriter::reserve(std::uint64_t size) {
    const std::uint64_t needed = size + summary_room_;
    if (offset_ + needed <= reserved_) return {};
    while (!set_aside(needed + ahead_)) {
        const bool full = errno == ENOSPC || errno == EDQUOT;
        if (!full) return {};
        if (ahead_ == 0) return not_written(path_);
        // To be refused so much takes long on some file systems: it is not asked for again.
        ahead_ = ahead_ > least_ahead ? ahead_ / 2 : 0;
    }
    return {};
}

/// Where the file system knows how: else the file lies in more pieces, and takes what there is.
bool McapWriter::set_aside(std::uint64_t size) {
    const auto at = static_cast<off_t>(offset_);
    if (::fallocate(file_.get(), FALLOC_FL_KEEP_SIZE, at, static_cast<off_t>(size)) != 0)
        return false;
    reserved_ = offset_ + size;
    return true;
}

}  // namespace versavis::client
