// SPDX-License-Identifier: BSD-3-Clause
// Fills messages that ROS 1 and ROS 2 have alike. For their times, a node defines
// versavis::set_time(its type&, OutputTime).
#pragma once

#include <string>

#include "ros_client/diagnostics.hpp"
#include "ros_client/names.hpp"
#include "versavis/stream.hpp"

namespace versavis::ros_client {

template <class Message>
void fill_header(Message& message, OutputTime time, const std::string& frame_id) {
    set_time(message.header.stamp, time);
    message.header.frame_id = frame_id;
}

/// False: the service overwrote the frame meanwhile; `message` is not one.
template <class Image>
bool fill_image(Image& message, const Frame& frame, const std::string& frame_id) {
    fill_header(message, frame.time.output(), frame_id);
    message.height = frame.data.height;
    message.width = frame.data.width;
    message.encoding = encoding_of(frame.data.pixel_format);
    message.is_bigendian = 0;
    message.step = frame.data.stride;
    message.data.resize(frame.payload.size());
    return frame.payload.copy_to(reinterpret_cast<std::byte*>(message.data.data()));
}

template <class Vector3>
void fill_vector(Vector3& vector, const float (&values)[3]) {
    vector.x = values[0];
    vector.y = values[1];
    vector.z = values[2];
}

/// Without orientation, and with unknown covariances.
template <class Imu>
void fill_imu(Imu& message, const ImuSample& sample, const std::string& frame_id) {
    fill_header(message, sample.time.output(), frame_id);
    message.orientation.w = 1;
    message.orientation_covariance[0] = -1;
    fill_vector(message.angular_velocity, sample.data.gyro);
    fill_vector(message.linear_acceleration, sample.data.accel);
}

template <class MagneticField>
void fill_magnetic_field(MagneticField& message, const ImuSample& sample,
                         const std::string& frame_id) {
    fill_header(message, sample.time.output(), frame_id);
    fill_vector(message.magnetic_field, sample.data.magnetic);
}

template <class Temperature>
void fill_temperature(Temperature& message, const ImuSample& sample, const std::string& frame_id) {
    fill_header(message, sample.time.output(), frame_id);
    message.temperature = sample.data.temperature;
}

/// What a PPS pulse was named. `event` is of the kind utc_label.
template <class TimeReference>
void fill_time_reference(TimeReference& message, const Event& event) {
    fill_header(message, event.time.output(), "board");
    set_time(message.time_ref, OutputTime{event.data.value * 1'000'000'000});
    message.source = "utc";
}

template <class DiagnosticArray>
void fill_diagnostics(DiagnosticArray& message, const std::vector<DiagnosticStatus>& statuses,
                      OutputTime now) {
    fill_header(message, now, "");
    for (const DiagnosticStatus& one : statuses) {
        auto& status = message.status.emplace_back();
        status.level = static_cast<decltype(status.level)>(one.level);
        status.name = one.name;
        status.message = one.message;
        status.hardware_id = one.hardware_id;
        for (const DiagnosticValue& value : one.values) {
            auto& pair = status.values.emplace_back();
            pair.key = value.key;
            pair.value = value.text;
        }
    }
}

}  // namespace versavis::ros_client
