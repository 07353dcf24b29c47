// SPDX-License-Identifier: BSD-3-Clause
// Fills messages of versavis_msgs: fields have the names of docs/contracts/shm-layout.md, and a
// value that is not known is an empty list.
#pragma once

#include <limits>
#include <string>
#include <type_traits>
#include <versavis_msgs/msg/event.hpp>
#include <versavis_msgs/msg/stamp.hpp>

#include "ros_client/messages.hpp"
#include "versavis/fields.hpp"

namespace versavis::ros2 {

/// The value of a field, by its name, into a member that is a number, a text, or a list of at most
/// one number.
class FieldReader {
 public:
    FieldReader(ring::StreamKind kind, const ring::Item& item) : kind_(kind), item_(item) {}

    template <class Member>
    void read(const char* name, Member& member) const {
        for (const Field& field : fields_of(kind_))
            if (std::string(field.name) == name)
                std::visit([&](const auto& value) { put(value, member); },
                           value_of(field, item_.metadata, item_.payload.attributes()));
    }

 private:
    template <class Value, class Member>
    static void put(const Value& value, Member& member) {
        if constexpr (std::is_arithmetic_v<Value> && std::is_arithmetic_v<Member>)
            member = static_cast<Member>(value);
        else if constexpr (std::is_arithmetic_v<Member> && std::is_same_v<Value, std::monostate>)
            member = std::numeric_limits<Member>::quiet_NaN();  // a float: others are lists
        else if constexpr (std::is_same_v<Value, std::string> && std::is_same_v<Member, Value>)
            member = value;
        else if constexpr (std::is_arithmetic_v<Value> && !std::is_same_v<Member, std::string>)
            member.push_back(static_cast<typename Member::value_type>(value));
    }

    ring::StreamKind kind_;
    const ring::Item& item_;
};

/// What messages of frames and events have alike.
template <class Message>
void fill_common(Message& message, const FieldReader& reader, const EpochTime& time,
                 const std::string& frame_id) {
    ros_client::fill_header(message, time.output(), frame_id);
    message.time_ns = time.ns;
    message.life = time.life;
    reader.read("epoch", message.epoch);
    reader.read("sigma_ns", message.sigma_ns);
    reader.read("kind", message.kind);
    reader.read("suspect", message.suspect);
    reader.read("second_doubted", message.second_doubted);
    reader.read("flags", message.flags);
    reader.read("board_time_ns", message.board_time_ns);
    reader.read("host_time_ns", message.host_time_ns);
}

inline void fill_stamp(versavis_msgs::msg::Stamp& message, const Frame& frame,
                       const std::string& frame_id) {
    const FieldReader reader(ring::StreamKind::frames, frame);
    fill_common(message, reader, frame.time, frame_id);
    reader.read("holdover", message.holdover);
    reader.read("clamped", message.clamped);
    reader.read("sensor_error", message.sensor_error);
    reader.read("camera_length", message.camera_length);
    reader.read("trigger", message.trigger);
    reader.read("tick", message.tick);
    reader.read("block_id", message.block_id);
    reader.read("arrival_ns", message.arrival_ns);
    reader.read("camera_time_ns", message.camera_time_ns);
    reader.read("exposure_ns", message.exposure_ns);
    reader.read("delay_ns", message.delay_ns);
    reader.read("width", message.width);
    reader.read("height", message.height);
    reader.read("stride", message.stride);
    reader.read("pixel_format", message.pixel_format);
    reader.read("format", message.format);
    reader.read("gain", message.gain);
    reader.read("temperature_c", message.temperature_c);
}

inline void fill_event(versavis_msgs::msg::Event& message, const Event& event,
                       const std::string& frame_id) {
    const FieldReader reader(ring::StreamKind::events, event);
    fill_common(message, reader, event.time, frame_id);
    reader.read("reason", message.reason);
    reader.read("source", message.source);
    reader.read("source_name", message.source_name);
    reader.read("value", message.value);
    reader.read("expected", message.expected);
    reader.read("count", message.count);
}

}  // namespace versavis::ros2
