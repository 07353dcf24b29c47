// SPDX-License-Identifier: BSD-3-Clause
// Writes small recordings for tests, as docs/contracts/recording-format.md says, cut off before a
// summary.
#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <map>
#include <string>

#include "versavis/ring_layout.hpp"
#include "versavis/time.hpp"

namespace versavis::test {

class RecordingSketch {
 public:
    RecordingSketch() {
        put_text(header_, "ros2");
        put_text(header_, "test");
        put(records_, std::uint8_t{0x03});  // of all channels
        std::string schema;
        put(schema, std::uint16_t{1});
        put_text(schema, "versavis.Item");
        put_text(schema, "");
        put(schema, std::uint32_t{0});
        put_content(records_, schema);
    }

    void add_item(const std::string& stream, ring::StreamKind kind, std::uint64_t number,
                  OutputTime time, const ring::Metadata& metadata) {
        std::string data;
        put(data, number);
        put(data, std::uint64_t{77});
        put(data, time.ns);
        put(data, std::uint64_t{0});
        put(data, metadata);
        std::string map;
        put_text(map, "kind");
        put_text(map, std::to_string(static_cast<unsigned>(kind)));
        put_text(map, "stream");
        put_text(map, stream);
        add("/versavis/" + stream + "/item", "versavis_item", number, time, data, map);
    }

    void add(const std::string& topic, const std::string& encoding, std::uint64_t number,
             OutputTime time, const std::string& data, const std::string& map = "") {
        const auto [known, is_new] =
            channels_.emplace(topic, static_cast<std::uint16_t>(channels_.size() + 1));
        if (is_new) {
            std::string channel;
            put(channel, known->second);
            put(channel, std::uint16_t{1});
            put_text(channel, topic);
            put_text(channel, encoding);
            put_text(channel, map);
            put(records_, std::uint8_t{0x04});
            put_content(records_, channel);
        }
        std::string message;
        put(message, known->second);
        put(message, static_cast<std::uint32_t>(number));
        put(message, time.ns);
        put(message, time.ns);
        message += data;
        put(records_, std::uint8_t{0x05});
        put_content(records_, message);
    }

    void write(const std::string& path) const {
        std::string text("\x89MCAP0\r\n", 8);
        put(text, std::uint8_t{0x01});
        put_content(text, header_);
        std::string metadata;
        put_text(metadata, "versavis");
        std::string version;
        put_text(version, "version");
        put_text(version, "1");
        put_text(metadata, version);
        put(text, std::uint8_t{0x0C});
        put_content(text, metadata);
        std::string chunk;
        put(chunk, std::uint64_t{0});
        put(chunk, std::uint64_t{0});
        put(chunk, static_cast<std::uint64_t>(records_.size()));
        put(chunk, std::uint32_t{0});
        put_text(chunk, "");
        put(chunk, static_cast<std::uint64_t>(records_.size()));
        chunk += records_;
        put(text, std::uint8_t{0x06});
        put_content(text, chunk);
        std::ofstream(path, std::ios::binary) << text;
    }

 private:
    template <class T>
    static void put(std::string& text, const T& value) {
        text.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    static void put_text(std::string& text, const std::string& value) {
        put(text, static_cast<std::uint32_t>(value.size()));
        text += value;
    }
    static void put_content(std::string& text, const std::string& content) {
        put(text, static_cast<std::uint64_t>(content.size()));
        text += content;
    }

    std::string header_;
    std::string records_;
    std::map<std::string, std::uint16_t> channels_;
};

}  // namespace versavis::test
