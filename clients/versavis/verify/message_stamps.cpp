// SPDX-License-Identifier: BSD-3-Clause
#include "verify/message_stamps.hpp"

#include <cstring>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "recording/mcap_reader.hpp"

namespace versavis::client {

namespace {

template <class T>
std::optional<T> read_at(std::span<const std::byte> data, std::size_t offset) {
    if (data.size() < offset + sizeof(T)) return std::nullopt;
    T value;
    std::memcpy(&value, data.data() + offset, sizeof value);
    return value;
}

std::string stream_of(const McapChannel& channel) {
    const auto named = channel.metadata.find("stream");
    if (named != channel.metadata.end()) return named->second;
    // Before version 2, topics of ROS had it as their first part only.
    return channel.topic.substr(1, channel.topic.find('/', 1) - 1);
}

/// Where the output time is in an item, by the encoding of its channel; none: it is no item.
std::optional<std::size_t> item_time_at(const McapChannel& channel) {
    const bool item = channel.topic.size() > 5 &&
                      channel.topic.compare(channel.topic.size() - 5, 5, "/item") == 0;
    if (channel.encoding == "versavis_item") return 16;  // before version 2
    if (!item || channel.encoding != "cdr") return std::nullopt;
    return 20;  // behind the four bytes that begin each CDR message
}

/// `header.stamp` of a message whose first field is a header.
std::optional<std::int64_t> header_stamp(std::span<const std::byte> data) {
    const auto seconds_part = read_at<std::int32_t>(data, 4);
    const auto ns_part = read_at<std::uint32_t>(data, 8);
    if (!seconds_part || !ns_part) return std::nullopt;
    return std::int64_t{*seconds_part} * seconds(1).ns + std::int64_t{*ns_part};
}

/// The messages of one item have its number in their stream as `sequence`, and are near it.
class Comparison {
 public:
    explicit Comparison(MessageStamps& differing) : differing_(differing) {}

    void add(const McapChannel& channel) { channels_[channel.id] = channel; }

    void add(const McapMessage& message) {
        const auto found = channels_.find(message.channel);
        if (found == channels_.end()) return;
        const McapChannel& channel = found->second;
        const std::string name = stream_of(channel);
        if (const auto at = item_time_at(channel)) {
            if (const auto time = read_at<std::int64_t>(message.data, *at))
                end_item(name, message.sequence, *time);
        } else if (channel.topic.rfind("/versavis/", 0) != 0 && channel.encoding == "cdr") {
            if (const auto stamp = header_stamp(message.data))
                take_stamp(name, message.sequence, *stamp);
        }
    }

 private:
    struct Stream {
        std::uint32_t sequence = 0;  ///< of the newest item
        std::int64_t time = 0;
        bool has_item = false;
        std::vector<std::pair<std::uint32_t, std::int64_t>> waiting;  ///< stamps before their item
    };

    void compare(const std::string& name, std::int64_t time, std::int64_t stamp) {
        if (stamp != time) differing_[name][time] = OutputTime{stamp} - OutputTime{time};
    }

    void end_item(const std::string& name, std::uint32_t sequence, std::int64_t time) {
        Stream& stream = streams_[name];
        for (const auto& [of, stamp] : stream.waiting)
            if (of == sequence) compare(name, time, stamp);
        // What belongs to no item by now was overwritten while it was recorded.
        stream.waiting.clear();
        stream.sequence = sequence;
        stream.time = time;
        stream.has_item = true;
    }

    void take_stamp(const std::string& name, std::uint32_t sequence, std::int64_t stamp) {
        Stream& stream = streams_[name];
        if (stream.has_item && stream.sequence == sequence)
            compare(name, stream.time, stamp);
        else
            stream.waiting.emplace_back(sequence, stamp);
    }

    MessageStamps& differing_;
    std::unordered_map<std::uint16_t, McapChannel> channels_;
    std::unordered_map<std::string, Stream> streams_;
};

}  // namespace

Expected<> compare_message_stamps(const std::string& path, MessageStamps& differing) {
    const auto reader = McapReader::open(path);
    if (!reader) return Unexpected(reader.error());
    Comparison comparison(differing);
    for (const McapChannel& channel : reader->channels()) comparison.add(channel);
    for (const McapChunk& chunk : reader->chunks()) {
        const auto visited = reader->glance(chunk, [&](const McapRecord& record) -> Expected<bool> {
            if (record.opcode == McapOpcode::channel) {
                if (const auto channel = parse_channel(record.content)) comparison.add(*channel);
            } else if (record.opcode == McapOpcode::message) {
                if (const auto message = parse_message(record.content)) comparison.add(*message);
            }
            return true;
        });
        // A damaged chunk has no items either: the recording's reader names it.
        static_cast<void>(visited);
    }
    return {};
}

}  // namespace versavis::client
