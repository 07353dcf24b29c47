// SPDX-License-Identifier: BSD-3-Clause
// All messages of an MCAP file, for tests that look at what was written.
#pragma once

#include <catch2/catch.hpp>
#include <cstdint>
#include <map>
#include <string>

#include "recording/mcap_reader.hpp"

namespace versavis::test {

/// Calls visit(topic, message) for each message, in the order of the file.
template <class Visit>
void for_each_message(const std::string& path, Visit visit) {
    using namespace client;
    const auto reader = McapReader::open(path);
    REQUIRE(reader);
    std::map<std::uint16_t, std::string> topics;
    for (const McapChannel& channel : reader->channels()) topics[channel.id] = channel.topic;
    McapBuffer buffer;
    for (const McapChunk& chunk : reader->chunks()) {
        const auto records = reader->load(chunk, buffer);
        REQUIRE(records);
        REQUIRE(reader->for_each(chunk, *records, [&](const McapRecord& record) {
            if (record.opcode != McapOpcode::message) return true;
            const auto message = parse_message(record.content);
            REQUIRE(message);
            visit(topics[message->channel], *message);
            return true;
        }));
    }
}

}  // namespace versavis::test
