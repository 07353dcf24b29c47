// SPDX-License-Identifier: BSD-3-Clause
// The end of an MCAP file: what its summary says, from the records before it.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace versavis::client {

struct SummaryChunk {
    std::uint64_t start_time;
    std::uint64_t end_time;
    std::uint64_t offset;
    std::uint64_t length;                            ///< opcode and length included
    std::map<std::uint16_t, std::uint64_t> indexes;  ///< where its message indexes lie
    std::uint64_t indexes_length;
    std::uint64_t records_size;
    std::string compression{};
    std::uint64_t packed_size = 0;  ///< of records that are compressed
};

struct SummaryAttachment {
    std::uint64_t offset;
    std::uint64_t length;
    std::uint64_t log_time;
    std::uint64_t create_time;
    std::uint64_t data_size;
    std::string name;
    std::string media_type;
};

struct SummaryMetadata {
    std::uint64_t offset;
    std::uint64_t length;
    std::string name;
};

struct McapSummary {
    std::map<std::uint16_t, std::string> schemas;   ///< contents of their records
    std::map<std::uint16_t, std::string> channels;  ///< likewise
    std::vector<SummaryChunk> chunks;
    std::vector<SummaryAttachment> attachments;
    std::vector<SummaryMetadata> metadata;
    std::map<std::uint16_t, std::uint64_t> messages;  ///< of each channel
    std::uint64_t start_time = 0;
    std::uint64_t end_time = 0;
};

struct MessagePlace {
    std::uint64_t log_time;
    std::uint64_t offset;  ///< in the chunk's records
};

/// The record that follows a chunk, for one of its channels.
std::string message_index(std::uint16_t channel, const std::vector<MessagePlace>& messages);

/// Data End, summary, footer and magic, for a file whose data end at `offset`.
std::string mcap_end(const McapSummary& summary, std::uint64_t offset);

}  // namespace versavis::client
