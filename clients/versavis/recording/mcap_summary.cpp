// SPDX-License-Identifier: BSD-3-Clause
#include "recording/mcap_summary.hpp"

#include <zlib.h>

#include <functional>

#include "recording/mcap_record.hpp"

namespace versavis::client {

namespace {

template <class Map>
std::string entries(const Map& map) {
    std::string list;
    for (const auto& [key, value] : map) list += mcap_number(key) + mcap_number(value);
    return mcap_text(list);
}

std::string chunk_index(const SummaryChunk& chunk) {
    return mcap_record(
        McapOpcode::chunk_index,
        mcap_number(chunk.start_time) + mcap_number(chunk.end_time) + mcap_number(chunk.offset) +
            mcap_number(chunk.length) + entries(chunk.indexes) + mcap_number(chunk.indexes_length) +
            mcap_text(chunk.compression) +
            mcap_number(chunk.compression.empty() ? chunk.records_size : chunk.packed_size) +
            mcap_number(chunk.records_size));
}

std::string attachment_index(const SummaryAttachment& one) {
    return mcap_record(McapOpcode::attachment_index,
                       mcap_number(one.offset) + mcap_number(one.length) +
                           mcap_number(one.log_time) + mcap_number(one.create_time) +
                           mcap_number(one.data_size) + mcap_text(one.name) +
                           mcap_text(one.media_type));
}

std::string statistics(const McapSummary& summary) {
    std::uint64_t messages = 0;
    for (const auto& [channel, count] : summary.messages) messages += count;
    return mcap_record(McapOpcode::statistics,
                       mcap_number(messages) +
                           mcap_number(static_cast<std::uint16_t>(summary.schemas.size())) +
                           mcap_number(static_cast<std::uint32_t>(summary.channels.size())) +
                           mcap_number(static_cast<std::uint32_t>(summary.attachments.size())) +
                           mcap_number(static_cast<std::uint32_t>(summary.metadata.size())) +
                           mcap_number(static_cast<std::uint32_t>(summary.chunks.size())) +
                           mcap_number(summary.start_time) + mcap_number(summary.end_time) +
                           entries(summary.messages));
}

/// Groups of equal records, and the records that say where each group lies.
class Groups {
 public:
    explicit Groups(std::uint64_t offset) : offset_(offset) {}

    void add(McapOpcode opcode, const std::string& records) {
        if (records.empty()) return;
        places_ += mcap_record(McapOpcode::summary_offset,
                               mcap_number(static_cast<std::uint8_t>(opcode)) +
                                   mcap_number(offset_ + bytes_.size()) +
                                   mcap_number(static_cast<std::uint64_t>(records.size())));
        bytes_ += records;
    }

    std::uint64_t begin() const { return offset_; }
    std::uint64_t places_begin() const { return offset_ + bytes_.size(); }
    std::string all() const { return bytes_ + places_; }

 private:
    std::uint64_t offset_;
    std::string bytes_;
    std::string places_;
};

}  // namespace

std::string message_index(std::uint16_t channel, const std::vector<MessagePlace>& messages) {
    std::string list;
    for (const MessagePlace& one : messages) {
        list += mcap_number(one.log_time);
        list += mcap_number(one.offset);
    }
    return mcap_record(McapOpcode::message_index, mcap_number(channel) + mcap_text(list));
}

std::string mcap_end(const McapSummary& summary, std::uint64_t offset) {
    const std::string data_end = mcap_record(McapOpcode::data_end, mcap_number(std::uint32_t{0}));
    Groups groups(offset + data_end.size());
    std::string schemas;
    for (const auto& [id, content] : summary.schemas)
        schemas += mcap_record(McapOpcode::schema, content);
    groups.add(McapOpcode::schema, schemas);
    std::string channels;
    for (const auto& [id, content] : summary.channels)
        channels += mcap_record(McapOpcode::channel, content);
    groups.add(McapOpcode::channel, channels);
    groups.add(McapOpcode::statistics, statistics(summary));
    std::string chunks;
    for (const auto& one : summary.chunks) chunks += chunk_index(one);
    groups.add(McapOpcode::chunk_index, chunks);
    std::string attachments;
    for (const auto& one : summary.attachments) attachments += attachment_index(one);
    groups.add(McapOpcode::attachment_index, attachments);
    std::string metadata;
    for (const auto& one : summary.metadata)
        metadata +=
            mcap_record(McapOpcode::metadata_index,
                        mcap_number(one.offset) + mcap_number(one.length) + mcap_text(one.name));
    groups.add(McapOpcode::metadata_index, metadata);
    // The CRC covers the footer up to itself.
    std::string end = groups.all() + mcap_number(static_cast<std::uint8_t>(McapOpcode::footer)) +
                      mcap_number(std::uint64_t{20}) + mcap_number(groups.begin()) +
                      mcap_number(groups.places_begin());
    const auto crc = static_cast<std::uint32_t>(
        crc32_z(crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(end.data()), end.size()));
    return data_end + end + mcap_number(crc) + mcap_magic;
}

}  // namespace versavis::client
