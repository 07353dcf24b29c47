// SPDX-License-Identifier: BSD-3-Clause
// Items of rings as messages of the ROS 2 package versavis_msgs (clients/ros/versavis_msgs), in
// CDR, and back. The fields of Stamp and Event are those of the table in versavis/fields.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "recording/mcap_reader.hpp"
#include "recording/mcap_writer.hpp"
#include "versavis/ring_layout.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

inline constexpr std::string_view item_type = "versavis_msgs/msg/Item";
inline constexpr std::string_view stamp_type = "versavis_msgs/msg/Stamp";
inline constexpr std::string_view event_type = "versavis_msgs/msg/Event";
inline constexpr std::string_view gap_type = "versavis_msgs/msg/Gap";
inline constexpr std::string_view sentence_type = "nmea_msgs/msg/Sentence";
inline constexpr std::string_view text_type = "std_msgs/msg/String";

/// What the messages of a channel are.
enum class Role { other, item, image, compressed, stamp, event, gap, status };

struct ChannelRole {
    Role role = Role::other;
    std::string stream;       ///< empty: of none
    ring::StreamKind kind{};  ///< of items
    bool old = false;         ///< as before version 2: not `cdr`
};

ChannelRole role_of(const McapChannel& channel);

/// The fields of one of versavis_msgs as its .msg file has them; empty: no such type.
std::string versavis_fields(std::string_view type);

/// An item, and its payload behind it; of a frame, gain and temperature.
struct ItemMessage {
    std::uint64_t number = 0;
    std::uint64_t life = 0;
    OutputTime time;
    std::uint32_t length = 0;  ///< of the payload in the ring
    ring::StreamKind kind{};
    ring::Metadata metadata{};
    std::span<const std::byte> payload{};

    /// Of a frame; files before version 1.2 have none.
    std::uint64_t attributes() const;
};

std::string item_message(const ItemMessage& item);

/// None: not such a message. One that is cut off within its payload has the beginning of it;
/// `payload_size` is what the whole has.
std::optional<ItemMessage> parse_item_message(std::span<const std::byte> message,
                                              std::uint64_t& payload_size);

/// The same of files before version 2, encoding `versavis_item`, whose kind the channel has.
/// `size`: of the whole message.
std::optional<ItemMessage> parse_old_item(std::span<const std::byte> message, std::uint64_t size,
                                          std::uint64_t& payload_size);

/// Stamp or Event, as fits the item; empty: its kind has neither.
std::string note_message(std::string_view stream, const ItemMessage& item);

/// What is missing after the item of the stamp `last`.
struct GapMessage {
    std::string reason;
    std::uint64_t items = 0;
    OutputTime last;
    std::uint32_t epoch = 0;
};

/// `time`: where it stands in the file.
std::string gap_message(std::string_view stream, OutputTime time, const GapMessage& gap);
std::optional<GapMessage> parse_gap_message(std::span<const std::byte> message);

/// The same of files before version 2: a JSON object.
std::optional<GapMessage> parse_old_gap(std::span<const std::byte> message);

/// std_msgs/msg/String.
std::string text_message(std::string_view text);

/// A channel of a recording, with the definition of its type. `kind`: of a channel of items.
/// The topic that role_of() finds its role by.
McapTopic recorded_topic(const std::string& topic, std::string_view type, const std::string& stream,
                         std::optional<ring::StreamKind> kind = std::nullopt);

}  // namespace versavis::client
