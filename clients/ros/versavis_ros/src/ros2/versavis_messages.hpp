// SPDX-License-Identifier: BSD-3-Clause
// Fills messages of versavis_msgs: fields have the names of docs/contracts/shm-layout.md, and a
// value that is not known is an empty list.
#pragma once

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

inline void fill_stamp(versavis_msgs::msg::Stamp& message, const Frame& frame,
                       const std::string& frame_id) {
    ros_client::fill_header(message, frame.time.output(), frame_id);
    message.time_ns = frame.time.ns;
    message.life = frame.time.life;
    const FieldReader reader(ring::StreamKind::frames, frame);
    reader.read("epoch", message.epoch);
    reader.read("sigma_ns", message.sigma_ns);
    reader.read("kind", message.kind);
    reader.read("suspect", message.suspect);
    reader.read("holdover", message.holdover);
    reader.read("clamped", message.clamped);
    reader.read("sensor_error", message.sensor_error);
    reader.read("camera_length", message.camera_length);
    reader.read("second_doubted", message.second_doubted);
    reader.read("flags", message.flags);
    reader.read("trigger", message.trigger);
    reader.read("tick", message.tick);
    reader.read("block_id", message.block_id);
    reader.read("board_time_ns", message.board_time_ns);
    reader.read("host_time_ns", message.host_time_ns);
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
    ros_client::fill_header(message, event.time.output(), frame_id);
    message.time_ns = event.time.ns;
    message.life = event.time.life;
    const FieldReader reader(ring::StreamKind::events, event);
    reader.read("epoch", message.epoch);
    reader.read("sigma_ns", message.sigma_ns);
    reader.read("kind", message.kind);
    reader.read("reason", message.reason);
    reader.read("source", message.source);
    reader.read("source_name", message.source_name);
    reader.read("value", message.value);
    reader.read("expected", message.expected);
    reader.read("count", message.count);
    reader.read("board_time_ns", message.board_time_ns);
    reader.read("host_time_ns", message.host_time_ns);
    reader.read("suspect", message.suspect);
    reader.read("second_doubted", message.second_doubted);
    reader.read("flags", message.flags);
}

}  // namespace versavis::ros2
