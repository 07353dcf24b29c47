// SPDX-License-Identifier: BSD-3-Clause
#include "export/bag_writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <lz4frame.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

namespace versavis::client {

namespace {

constexpr std::string_view magic = "#ROSBAG V2.0\n";
constexpr std::size_t bag_header_size = 4096;  ///< the format fixes it

/// A chunk ends at this size, which ROS itself uses. If lower, there are more index records; if
/// higher, a reader that wants one message decompresses more.
constexpr std::size_t chunk_threshold = 768 << 10U;

enum class Op : std::uint8_t {
    message = 2,
    header = 3,
    index = 4,
    chunk = 5,
    chunk_info = 6,
    connection = 7,
};

template <class T>
std::string raw(T value) {
    return {reinterpret_cast<const char*>(&value), sizeof value};
}

std::string field(std::string_view name, std::string_view value) {
    return raw(static_cast<std::uint32_t>(name.size() + 1 + value.size())) + std::string(name) +
           "=" + std::string(value);
}

std::string header(Op op, const std::string& fields) {
    const std::string all = field("op", raw(static_cast<std::uint8_t>(op))) + fields;
    return raw(static_cast<std::uint32_t>(all.size())) + all;
}

std::string record(Op op, const std::string& fields, const std::string& data) {
    return header(op, fields) + raw(static_cast<std::uint32_t>(data.size())) + data;
}

std::string bag_header(std::uint64_t index, std::uint32_t connections, std::uint32_t chunks) {
    const std::string head =
        header(Op::header, field("index_pos", raw(index)) + field("conn_count", raw(connections)) +
                               field("chunk_count", raw(chunks)));
    const std::size_t padding = bag_header_size - head.size() - 4;
    return std::string(magic) + head + raw(static_cast<std::uint32_t>(padding)) +
           std::string(padding, ' ');
}

std::uint64_t bag_time(std::int64_t ns) {
    constexpr std::int64_t second = 1'000'000'000;
    return static_cast<std::uint64_t>(ns / second) | static_cast<std::uint64_t>(ns % second) << 32U;
}

std::span<const std::byte> as_bytes(const std::string& text) {
    return std::as_bytes(std::span(text.data(), text.size()));
}

void put(std::vector<std::byte>& into, std::span<const std::byte> bytes) {
    into.insert(into.end(), bytes.begin(), bytes.end());
}

}  // namespace

BagWriter::BagWriter(std::string path, FileDescriptor file, BagCompression compression)
    : path_(std::move(path)), file_(std::move(file)), compression_(compression) {}

Expected<BagWriter> BagWriter::create(const std::string& path, BagCompression compression) {
    auto file = create_file(path, O_WRONLY);
    if (!file) return Unexpected(file.error());
    BagWriter writer(path, std::move(*file), compression);
    if (auto begun = writer.append(bag_header(0, 0, 0)); !begun) return Unexpected(begun.error());
    return writer;
}

Expected<> BagWriter::append(std::string_view bytes) {
    at_ += bytes.size();
    return write_all(file_, path_, bytes);
}

std::uint32_t BagWriter::add_connection(const std::string& topic, const BagType& type) {
    const auto number = static_cast<std::uint32_t>(connections_.size());
    const std::string data = field("topic", topic) + field("type", type.name) +
                             field("md5sum", type.md5) +
                             field("message_definition", type.definition);
    connections_.push_back(
        {record(Op::connection, field("conn", raw(number)) + field("topic", topic), data)});
    return number;
}

Expected<> BagWriter::write(std::uint32_t connection, std::int64_t time_ns,
                            std::span<const std::byte> head, std::span<const std::byte> body) {
    if (time_ns < 0 || time_ns / 1'000'000'000 > 0xFFFFFFFFLL)
        return failure(path_, fmt::format("a bag cannot hold the time {} ns", time_ns),
                       "record with 'output = \"realtime\"'");
    const std::uint64_t size = head.size() + body.size();
    if (size > 0x7FFFFFFFU)
        return failure(path_, "a message has more than 2 GiB, which a bag cannot hold");
    if (!chunk_.empty() && chunk_.size() + size > chunk_threshold)
        if (auto ended = end_chunk(); !ended) return ended;
    Connection& its = connections_.at(connection);
    if (!its.listed) put(chunk_, as_bytes(its.record));
    its.listed = true;
    const std::uint64_t time = bag_time(time_ns);
    index_[connection].push_back({time, static_cast<std::uint32_t>(chunk_.size())});
    put(chunk_,
        as_bytes(header(Op::message, field("conn", raw(connection)) + field("time", raw(time))) +
                 raw(static_cast<std::uint32_t>(size))));
    put(chunk_, head);
    put(chunk_, body);
    return {};
}

Expected<std::vector<std::byte>> BagWriter::compressed() const {
    LZ4F_preferences_t preferences{};
    // ROS refuses frames without the checksum of their content, with blocks that lean on those
    // before, or with the size of their content.
    preferences.frameInfo.contentChecksumFlag = LZ4F_contentChecksumEnabled;
    preferences.frameInfo.blockMode = LZ4F_blockIndependent;
    preferences.frameInfo.blockSizeID = LZ4F_max4MB;
    std::vector<std::byte> out(LZ4F_compressFrameBound(chunk_.size(), &preferences));
    const std::size_t size =
        LZ4F_compressFrame(out.data(), out.size(), chunk_.data(), chunk_.size(), &preferences);
    if (LZ4F_isError(size) != 0U)
        return failure(path_, std::string("LZ4: ") + LZ4F_getErrorName(size));
    out.resize(size);
    return out;
}

Expected<> BagWriter::end_chunk() {
    if (chunk_.empty()) return {};
    ChunkInfo info{at_, ~std::uint64_t{0}, 0, {}};
    const auto later = [](std::uint64_t time) { return time << 32U | time >> 32U; };
    for (const auto& [connection, entries] : index_) {
        info.messages[connection] = static_cast<std::uint32_t>(entries.size());
        for (const Entry& entry : entries) {
            if (info.first == ~std::uint64_t{0} || later(entry.time) < later(info.first))
                info.first = entry.time;
            if (later(entry.time) > later(info.last)) info.last = entry.time;
        }
    }
    const bool plain = compression_ == BagCompression::none;
    const auto packed =
        plain ? Expected<std::vector<std::byte>>(std::vector<std::byte>()) : compressed();
    if (!packed) return Unexpected(packed.error());
    const std::span<const std::byte> data = plain ? std::span<const std::byte>(chunk_) : *packed;
    std::string head =
        header(Op::chunk, field("compression", plain ? "none" : "lz4") +
                              field("size", raw(static_cast<std::uint32_t>(chunk_.size())))) +
        raw(static_cast<std::uint32_t>(data.size()));
    if (auto written = append(head); !written) return written;
    const auto* text = reinterpret_cast<const char*>(data.data());
    if (auto written = append({text, data.size()}); !written) return written;
    std::string indexes;
    for (const auto& [connection, entries] : index_) {
        std::string list;
        for (const Entry& entry : entries) list += raw(entry.time) + raw(entry.offset);
        indexes += record(Op::index,
                          field("ver", raw(std::uint32_t{1})) + field("conn", raw(connection)) +
                              field("count", raw(static_cast<std::uint32_t>(entries.size()))),
                          list);
    }
    chunks_.push_back(std::move(info));
    chunk_.clear();
    index_.clear();
    return append(indexes);
}

Expected<> BagWriter::finish() {
    if (auto ended = end_chunk(); !ended) return ended;
    const std::uint64_t index = at_;
    std::uint32_t listed = 0;
    for (const Connection& connection : connections_) {
        if (!connection.listed) continue;  // it had no message
        if (auto written = append(connection.record); !written) return written;
        ++listed;
    }
    for (const ChunkInfo& chunk : chunks_) {
        std::string list;
        for (const auto& [connection, count] : chunk.messages) list += raw(connection) + raw(count);
        const std::string fields =
            field("ver", raw(std::uint32_t{1})) + field("chunk_pos", raw(chunk.position)) +
            field("start_time", raw(chunk.first)) + field("end_time", raw(chunk.last)) +
            field("count", raw(static_cast<std::uint32_t>(chunk.messages.size())));
        if (auto written = append(record(Op::chunk_info, fields, list)); !written) return written;
    }
    const std::string head = bag_header(index, listed, static_cast<std::uint32_t>(chunks_.size()));
    if (::pwrite(file_.get(), head.data(), head.size(), 0) != static_cast<ssize_t>(head.size()))
        return not_written(path_);
    return sync_file(file_, path_);
}

}  // namespace versavis::client
