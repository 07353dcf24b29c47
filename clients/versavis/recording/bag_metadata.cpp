// SPDX-License-Identifier: BSD-3-Clause
#include "recording/bag_metadata.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>

#include "recording/mcap_reader.hpp"

namespace versavis::client {

namespace {

/// That of humble, which later ones read, too; foxy, which wrote 4, ignores what came with 5.
constexpr int bag_version = 5;

struct BagTopic {
    std::string type;
    std::uint64_t messages = 0;
};

/// In YAML, as in JSON: a name of a file may have any characters.
std::string yaml_text(const std::string& text) {
    std::string quoted = "\"";
    for (const char one : text)
        if (one == '"' || one == '\\')
            quoted += std::string("\\") + one;
        else if (static_cast<unsigned char>(one) < ' ')
            quoted += fmt::format("\\x{:02x}", one);
        else
            quoted += one;
    return quoted + "\"";
}

struct BagSpan {
    std::uint64_t first = std::numeric_limits<std::uint64_t>::max();
    std::uint64_t last = 0;
    std::uint64_t messages = 0;

    void add(const McapStatistics& file) {
        if (file.messages == 0) return;
        first = std::min(first, file.start_time);
        last = std::max(last, file.end_time);
        messages += file.messages;
    }

    std::string text(const std::string& indent) const {
        return fmt::format(
            "{0}starting_time:\n{0}  nanoseconds_since_epoch: {1}\n{0}duration:\n"
            "{0}  nanoseconds: {2}\n{0}message_count: {3}\n",
            indent, messages == 0 ? 0 : first, messages == 0 ? 0 : last - first, messages);
    }
};

}  // namespace

Expected<std::string> bag_metadata(const std::vector<std::string>& files) {
    std::map<std::string, BagTopic> topics;
    BagSpan all;
    std::string paths;
    std::string spans;
    for (const std::string& file : files) {
        const auto reader = McapReader::open(file);
        if (!reader) return Unexpected(reader.error());
        if (!reader->statistics()) return failure(file, "has no summary", "repair it first");
        const McapStatistics& statistics = *reader->statistics();
        for (const McapChannel& channel : reader->channels()) {
            BagTopic& topic = topics[channel.topic];
            const auto schema = reader->schemas().find(channel.schema);
            if (schema != reader->schemas().end()) topic.type = schema->second.name;
            const auto counted = statistics.of_channel.find(channel.id);
            if (counted != statistics.of_channel.end()) topic.messages += counted->second;
        }
        BagSpan one;
        one.add(statistics);
        all.add(statistics);
        const std::string name = yaml_text(std::filesystem::path(file).filename().string());
        paths += fmt::format("    - {}\n", name);
        spans += fmt::format("    - path: {}\n{}", name, one.text("      "));
    }
    std::string text = fmt::format(
        "rosbag2_bagfile_information:\n  version: {}\n  storage_identifier: mcap\n{}"
        "  topics_with_message_count:\n",
        bag_version, all.text("  "));
    for (const auto& [name, topic] : topics)
        text += fmt::format(
            "    - topic_metadata:\n        name: {}\n        type: {}\n"
            "        serialization_format: cdr\n        offered_qos_profiles: \"\"\n"
            "      message_count: {}\n",
            name, topic.type, topic.messages);
    return text + "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n" +
           paths + "  files:\n" + spans;
}

}  // namespace versavis::client
