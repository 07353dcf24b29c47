// SPDX-License-Identifier: BSD-3-Clause
#include "export/ros1_messages.hpp"

#include <cstring>

namespace versavis::client {

namespace {

/// Stands before the definition of each type that another one uses.
#define VERSAVIS_DEPENDENCY(name)                                                        \
    "================================================================================\n" \
    "MSG: " name "\n"

// Source: common_msgs 1.13 and std_msgs 0.5; their MD5 sums ignore comments.
constexpr auto header_definition =
    VERSAVIS_DEPENDENCY("std_msgs/Header") "uint32 seq\ntime stamp\nstring frame_id\n";

class Serialiser {
 public:
    template <class T>
    void number(T value) {
        const auto* bytes = reinterpret_cast<const std::byte*>(&value);
        bytes_.insert(bytes_.end(), bytes, bytes + sizeof value);
    }

    void text(const std::string& text) {
        number(static_cast<std::uint32_t>(text.size()));
        const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
        bytes_.insert(bytes_.end(), bytes, bytes + text.size());
    }

    void header(const Ros1Header& header) {
        constexpr std::int64_t second = 1'000'000'000;
        number(header.sequence);
        number(static_cast<std::uint32_t>(header.stamp_ns / second));
        number(static_cast<std::uint32_t>(header.stamp_ns % second));
        text(header.frame_id);
    }

    void numbers(std::size_t count, double value) {
        for (std::size_t i = 0; i < count; ++i) number(value);
    }

    std::vector<std::byte> take() { return std::move(bytes_); }

 private:
    std::vector<std::byte> bytes_;
};

}  // namespace

const BagType ros1_image{"sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743",
                         std::string("Header header\nuint32 height\nuint32 width\nstring encoding\n"
                                     "uint8 is_bigendian\nuint32 step\nuint8[] data\n") +
                             header_definition};

const BagType ros1_imu{
    "sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2",
    std::string("Header header\ngeometry_msgs/Quaternion orientation\n"
                "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
                "float64[9] angular_velocity_covariance\n"
                "geometry_msgs/Vector3 linear_acceleration\n"
                "float64[9] linear_acceleration_covariance\n") +
        header_definition +
        VERSAVIS_DEPENDENCY("geometry_msgs/Quaternion") "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
        VERSAVIS_DEPENDENCY("geometry_msgs/Vector3") "float64 x\nfloat64 y\nfloat64 z\n"};

#undef VERSAVIS_DEPENDENCY

std::vector<std::byte> ros1_image_head(const Ros1Header& header, std::uint32_t width,
                                       std::uint32_t height, const std::string& encoding,
                                       std::uint32_t step, std::uint32_t size) {
    Serialiser message;
    message.header(header);
    message.number(height);
    message.number(width);
    message.text(encoding);
    message.number(std::uint8_t{0});  // little-endian
    message.number(step);
    message.number(size);
    return message.take();
}

std::vector<std::byte> ros1_imu_message(const Ros1Header& header, const ImuMetadata& sample) {
    constexpr double no_orientation = -1;
    Serialiser message;
    message.header(header);
    message.numbers(4, 0);
    message.number(no_orientation);
    message.numbers(8, 0);
    for (const float value : sample.gyro) message.number(double{value});
    message.numbers(9, 0);
    for (const float value : sample.accel) message.number(double{value});
    message.numbers(9, 0);
    return message.take();
}

}  // namespace versavis::client
