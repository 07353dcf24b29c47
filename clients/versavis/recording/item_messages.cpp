// SPDX-License-Identifier: BSD-3-Clause
#include "recording/item_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "base/byte_cursor.hpp"
#include "base/shallow_json.hpp"
#include "recording/cdr_writer.hpp"
#include "recording/ros_messages.hpp"
#include "versavis/fields.hpp"
#include "versavis/ring_path.hpp"

namespace versavis::client {

namespace {

constexpr std::size_t encapsulation_size = 4;
constexpr std::size_t item_head_size = 128;  ///< of fields before the payload

constexpr std::string_view item_fields =
    "uint64 number\nuint64 life\nint64 time_ns\nuint32 length\nuint32 kind\n"
    "uint64[12] metadata\nuint8[] payload\n";
constexpr std::string_view gap_fields =
    "std_msgs/Header header\nstring reason\nuint64 items\nint64 time_ns\nuint32 epoch\n";
constexpr std::string_view note_head = "std_msgs/Header header\nint64 time_ns\nuint64 life\n";

const char* ros_type(FieldType type) {
    switch (type) {
        case FieldType::u32: return "uint32";
        case FieldType::u64:
        case FieldType::tick: return "uint64";
        case FieldType::i32: return "int32";
        case FieldType::i64: return "int64";
        case FieldType::f32: return "float32";
        case FieldType::flag: return "bool";
        case FieldType::text:
        case FieldType::stamp_kind:
        case FieldType::event_kind:
        case FieldType::event_reason:
        case FieldType::pixel_format: return "string";
    }
    return "";
}

/// An unknown number has no value of its own in CDR: it is a list of at most one. An unknown
/// float is NaN.
bool is_optional(const Field& field) {
    return field.unknown != UnknownIf::never && field.type != FieldType::f32;
}

std::string note_fields(ring::StreamKind kind) {
    std::string text(note_head);
    for (const Field& field : fields_of(kind)) {
        const std::string count = is_optional(field) ? "[<=1]"
                                  : field.count == 1 ? ""
                                                     : fmt::format("[{}]", field.count);
        text += fmt::format("{}{} {}\n", ros_type(field.type), count, field.name);
    }
    return text;
}

/// Of the width that ros_type() has for it.
void put_number(CdrWriter& message, FieldType type, const FieldValue& value) {
    const auto as = [&]<class T>(T /*of the type*/) {
        message.number(std::visit(
            [](const auto& known) {
                if constexpr (std::is_arithmetic_v<std::decay_t<decltype(known)>>)
                    return static_cast<T>(known);
                else
                    return T{};
            },
            value));
    };
    switch (type) {
        case FieldType::u32: as(std::uint32_t{}); break;
        case FieldType::u64:
        case FieldType::tick: as(std::uint64_t{}); break;
        case FieldType::i32: as(std::int32_t{}); break;
        case FieldType::i64: as(std::int64_t{}); break;
        case FieldType::flag: as(std::uint8_t{}); break;
        default: break;
    }
}

void put_field(CdrWriter& message, const Field& field, const ItemMessage& item) {
    for (unsigned i = 0; i < field.count; ++i) {
        const FieldValue value = value_of(field, item.metadata, item.attributes(), i);
        const bool known = !std::holds_alternative<std::monostate>(value);
        if (is_optional(field)) {
            message.number(std::uint32_t{known});
            if (!known) continue;
        }
        if (const auto* text = std::get_if<std::string>(&value))
            message.text(*text);
        else if (field.type == FieldType::f32)
            message.number(known ? std::get<float>(value)
                                 : std::numeric_limits<float>::quiet_NaN());
        else
            put_number(message, field.type, value);
    }
}

std::optional<ItemMessage> item_head(ByteCursor& cursor) {
    ItemMessage item;
    item.number = cursor.number<std::uint64_t>();
    item.life = cursor.number<std::uint64_t>();
    item.time = {cursor.number<std::int64_t>()};
    item.length = cursor.number<std::uint32_t>();
    item.kind = static_cast<ring::StreamKind>(cursor.number<std::uint32_t>());
    for (auto& word : item.metadata) word = cursor.number<std::uint64_t>();
    if (!cursor.good()) return std::nullopt;
    return item;
}

bool is_little_endian_cdr(ByteCursor& cursor) {
    const auto head = cursor.bytes(encapsulation_size);
    return !head.empty() && head[0] == std::byte{0} && head[1] == std::byte{1};
}

std::string cdr_string(ByteCursor& cursor) {
    cursor.align(4, encapsulation_size);
    const std::string_view text = cursor.text();
    return std::string(text.substr(0, text.empty() ? 0 : text.size() - 1));  // without its zero
}

std::string metadata_text(const McapChannel& channel, const char* key) {
    const auto found = channel.metadata.find(key);
    return found == channel.metadata.end() ? std::string() : found->second;
}

template <class T>
T cdr_value(ByteCursor& cursor) {
    cursor.align(sizeof(T), encapsulation_size);
    return cursor.number<T>();
}

}  // namespace

ChannelRole role_of(const McapChannel& channel) {
    ChannelRole found;
    found.old = channel.encoding != "cdr";
    const std::string_view topic = channel.topic;
    constexpr std::string_view own = "/versavis/";
    const bool is_own = topic.starts_with(own);
    const std::string_view path =
        topic.substr(is_own ? own.size() : std::min<std::size_t>(1, topic.size()));
    const std::size_t slash = path.find('/');
    const std::string_view rest = slash == path.npos ? std::string_view() : path.substr(slash + 1);
    // Before version 2 only the topic had the stream's name.
    found.stream = path.substr(0, slash == path.npos && !is_own ? 0 : slash);
    if (auto given = metadata_text(channel, "stream"); !given.empty()) found.stream = given;
    if (!is_stream_name(found.stream)) return {};
    if (is_own && rest == "item") {
        const std::string kind = metadata_text(channel, "kind");
        const bool known = kind.size() == 1 && kind[0] >= '1' && kind[0] <= '7';
        if (!known || (found.old && channel.encoding != "versavis_item")) return {};
        found.kind = static_cast<ring::StreamKind>(kind[0] - '0');
        found.role = Role::item;
        return found;
    }
    if (found.old && channel.encoding != "json") return {};
    if (is_own && rest == "stamp") found.role = Role::stamp;
    if (is_own && rest == "gap") found.role = Role::gap;
    if (topic == "/versavis/events") found.role = Role::event;
    if (topic == "/versavis/status") found.role = Role::status;
    if (!is_own && !found.old && rest == "image_raw") found.role = Role::image;
    if (!is_own && !found.old && rest == "image_raw/compressed") found.role = Role::compressed;
    return found;
}

std::string versavis_fields(std::string_view type) {
    if (type == item_type) return std::string(item_fields);
    if (type == stamp_type) return note_fields(ring::StreamKind::frames);
    if (type == event_type) return note_fields(ring::StreamKind::events);
    if (type == gap_type) return std::string(gap_fields);
    return {};
}

std::uint64_t ItemMessage::attributes() const {
    if (kind != ring::StreamKind::frames || payload.size() < sizeof(std::uint64_t))
        return ring::no_attributes;
    return ByteCursor(payload).number<std::uint64_t>();
}

std::string item_message(const ItemMessage& item) {
    CdrWriter message;
    message.number(item.number).number(item.life).number(item.time.ns).number(item.length);
    message.number(static_cast<std::uint32_t>(item.kind)).numbers(item.metadata);
    // Those of before version 1.2 have no attributes.
    const std::uint64_t attributes = item.attributes();
    const auto payload = item.kind == ring::StreamKind::frames
                             ? std::as_bytes(std::span(&attributes, 1))
                             : item.payload;
    message.number(static_cast<std::uint32_t>(payload.size()));
    return message.bytes() + std::string(as_text(payload));
}

std::optional<ItemMessage> parse_item_message(std::span<const std::byte> message,
                                              std::uint64_t& payload_size) {
    ByteCursor cursor(message);
    if (!is_little_endian_cdr(cursor)) return std::nullopt;
    auto item = item_head(cursor);
    payload_size = cursor.number<std::uint32_t>();
    if (!item || !cursor.good()) return std::nullopt;
    item->payload = cursor.bytes(std::min<std::uint64_t>(payload_size, cursor.left()));
    return item;
}

std::optional<ItemMessage> parse_old_item(std::span<const std::byte> message, std::uint64_t size,
                                          std::uint64_t& payload_size) {
    ByteCursor cursor(message);
    auto item = item_head(cursor);
    if (!item) return std::nullopt;
    payload_size = size - item_head_size;
    item->payload = cursor.bytes(cursor.left());
    return item;
}

std::string note_message(std::string_view stream, const ItemMessage& item) {
    if (item.kind != ring::StreamKind::frames && item.kind != ring::StreamKind::events) return {};
    CdrWriter message;
    message.header(item.time, stream).number(item.time.ns).number(item.life);
    for (const Field& field : fields_of(item.kind)) put_field(message, field, item);
    return message.bytes();
}

std::string gap_message(std::string_view stream, OutputTime time, const GapMessage& gap) {
    return CdrWriter()
        .header(time, stream)
        .text(gap.reason)
        .number(gap.items)
        .number(gap.last.ns)
        .number(gap.epoch)
        .bytes();
}

std::optional<GapMessage> parse_gap_message(std::span<const std::byte> message) {
    ByteCursor cursor(message);
    if (!is_little_endian_cdr(cursor)) return std::nullopt;
    cursor.bytes(8);  // stamp
    cdr_string(cursor);
    GapMessage gap;
    gap.reason = cdr_string(cursor);
    gap.items = cdr_value<std::uint64_t>(cursor);
    gap.last = {cdr_value<std::int64_t>(cursor)};
    gap.epoch = cdr_value<std::uint32_t>(cursor);
    if (!cursor.good()) return std::nullopt;
    return gap;
}

std::optional<GapMessage> parse_old_gap(std::span<const std::byte> message) {
    const auto json = parse_shallow_json(std::string(as_text(message)));
    if (!json.is_object()) return std::nullopt;
    const auto number = [&](const char* name) {
        const auto found = json.find(name);
        return found != json.end() && found->is_number_integer() ? found->get<std::int64_t>() : 0;
    };
    const auto reason = json.find("reason");
    GapMessage gap;
    gap.reason =
        reason != json.end() && reason->is_string() ? reason->get<std::string>() : "unknown";
    gap.items = static_cast<std::uint64_t>(std::max<std::int64_t>(number("items"), 0));
    gap.last = {number("time_ns")};
    gap.epoch = static_cast<std::uint32_t>(number("epoch"));
    return gap;
}

std::string text_message(std::string_view text) { return CdrWriter().text(text).bytes(); }

McapTopic recorded_topic(const std::string& topic, std::string_view type, const std::string& stream,
                         std::optional<ring::StreamKind> kind) {
    // The profile wants QoS of publishers. None: a player offers its default, to which every
    // subscriber fits. Versions of rosbag2 disagree on how policies are spelled.
    std::map<std::string, std::string> metadata{{"offered_qos_profiles", ""}, {"stream", stream}};
    if (kind) metadata["kind"] = std::to_string(static_cast<std::uint32_t>(*kind));
    return {topic, "cdr", std::string(type), "ros2msg", ros_definition(type), std::move(metadata)};
}

}  // namespace versavis::client
