// SPDX-License-Identifier: BSD-3-Clause
#include "recording/ros_messages.hpp"

#include <fmt/format.h>

#include <array>
#include <map>
#include <vector>

#include "recording/cdr_writer.hpp"
#include "recording/item_messages.hpp"
#include "ros_client/names.hpp"

namespace versavis::client {

namespace {

constexpr std::string_view header = "std_msgs/Header";
constexpr std::string_view vector3 = "geometry_msgs/Vector3";

struct Definition {
    std::string fields;
    std::vector<std::string_view> parts;  ///< types that it is made of, all levels
};

const std::map<std::string_view, Definition>& definitions() {
    static const std::map<std::string_view, Definition> all{
        {"sensor_msgs/msg/Image",
         {"std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n"
          "uint8 is_bigendian\nuint32 step\nuint8[] data\n",
          {header}}},
        {"sensor_msgs/msg/CompressedImage",
         {"std_msgs/Header header\nstring format\nuint8[] data\n", {header}}},
        {"sensor_msgs/msg/CameraInfo",
         {"std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n"
          "float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\n"
          "uint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
          {header, "sensor_msgs/RegionOfInterest"}}},
        {"sensor_msgs/msg/Imu",
         {"std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
          "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
          "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
          "float64[9] linear_acceleration_covariance\n",
          {header, "geometry_msgs/Quaternion", vector3}}},
        {"sensor_msgs/msg/MagneticField",
         {"std_msgs/Header header\ngeometry_msgs/Vector3 magnetic_field\n"
          "float64[9] magnetic_field_covariance\n",
          {header, vector3}}},
        {"sensor_msgs/msg/Temperature",
         {"std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n", {header}}},
        {"sensor_msgs/msg/TimeReference",
         {"std_msgs/Header header\nbuiltin_interfaces/Time time_ref\nstring source\n", {header}}},
        {sentence_type, {"std_msgs/Header header\nstring sentence\n", {header}}},
        {text_type, {"string data\n", {}}},
        {item_type, {versavis_fields(item_type), {}}},
        {stamp_type, {versavis_fields(stamp_type), {header}}},
        {event_type, {versavis_fields(event_type), {header}}},
        {gap_type, {versavis_fields(gap_type), {header}}}};
    return all;
}

constexpr std::pair<std::string_view, std::string_view> part_definitions[]{
    {header, "builtin_interfaces/Time stamp\nstring frame_id\n"},
    {"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"},
    {"geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"},
    {vector3, "float64 x\nfloat64 y\nfloat64 z\n"},
    {"sensor_msgs/RegionOfInterest",
     "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"}};

std::string part(std::string_view name) {
    for (const auto& [type, fields] : part_definitions)
        if (type == name) return fmt::format("{:=>80}\nMSG: {}\n{}", "", name, fields);
    return {};
}

constexpr std::array<double, 9> unknown{};  ///< a covariance

}  // namespace

std::string ros_image_head(OutputTime time, std::string_view stream, const FrameMetadata& frame,
                           std::uint32_t length) {
    constexpr std::uint8_t little_endian = 0;
    return CdrWriter()
        .header(time, stream)
        .number(frame.height)
        .number(frame.width)
        .text(ros_client::encoding_of(frame.pixel_format))
        .number(little_endian)
        .number(frame.stride)
        .number(length)
        .bytes();
}

std::string ros_compressed_head(OutputTime time, std::string_view stream, std::string_view format,
                                std::uint32_t length) {
    return CdrWriter().header(time, stream).text(format).number(length).bytes();
}

std::string ros_png_head(OutputTime time, std::string_view stream, const FrameMetadata& frame,
                         std::uint32_t length) {
    const std::string encoding = ros_client::encoding_of(frame.pixel_format);
    return ros_compressed_head(time, stream, encoding + "; png compressed " + encoding, length);
}

std::string ros_camera_info(OutputTime time, std::string_view stream, const FrameMetadata& frame,
                            const RosLens* lens) {
    const bool known =
        lens != nullptr && lens->width == frame.width && lens->height == frame.height;
    const RosLens all = known ? *lens : RosLens{};
    const double one = known ? 1 : 0;  // k of zeros: not calibrated
    CdrWriter message;
    message.header(time, stream).number(frame.height).number(frame.width).text(all.distortion);
    message.number(static_cast<std::uint32_t>(all.coefficients.size()));
    for (const double coefficient : all.coefficients) message.number(coefficient);
    message.numbers(std::array{all.fx, 0.0, all.cx, 0.0, all.fy, all.cy, 0.0, 0.0, one});  // k
    message.numbers(std::array{one, 0.0, 0.0, 0.0, one, 0.0, 0.0, 0.0, one});              // r
    message.numbers(
        std::array{all.fx, 0.0, all.cx, 0.0, 0.0, all.fy, all.cy, 0.0, 0.0, 0.0, one, 0.0});  // p
    message.numbers(std::array<std::uint32_t, 2>{});                          // binning
    message.numbers(std::array<std::uint32_t, 4>{}).number(std::uint8_t{0});  // roi: all
    return message.bytes();
}

std::string ros_imu(OutputTime time, std::string_view stream, const ImuMetadata& sample) {
    constexpr std::array<double, 4> no_orientation{0, 0, 0, 1};
    constexpr std::array<double, 9> not_estimated{-1};
    CdrWriter message;
    message.header(time, stream).numbers(no_orientation).numbers(not_estimated);
    for (const float rate : sample.gyro) message.number(static_cast<double>(rate));
    message.numbers(unknown);
    for (const float acceleration : sample.accel) message.number(static_cast<double>(acceleration));
    return message.numbers(unknown).bytes();
}

std::string ros_magnetic_field(OutputTime time, std::string_view stream,
                               const ImuMetadata& sample) {
    CdrWriter message;
    message.header(time, stream);
    for (const float field : sample.magnetic) message.number(static_cast<double>(field));
    return message.numbers(unknown).bytes();
}

std::string ros_temperature(OutputTime time, std::string_view stream, const ImuMetadata& sample) {
    return CdrWriter()
        .header(time, stream)
        .number(static_cast<double>(sample.temperature))
        .number(0.0)
        .bytes();
}

std::string ros_sentence(OutputTime time, std::string_view stream, std::string_view text) {
    return CdrWriter().header(time, stream).text(text).bytes();
}

std::string ros_utc(OutputTime time, OutputTime utc) {
    return CdrWriter().header(time, "board").time(utc).text("utc").bytes();
}

std::string ros_definition(std::string_view type) {
    const auto found = definitions().find(type);
    if (found == definitions().end()) return {};
    std::string text(found->second.fields);
    for (const std::string_view name : found->second.parts) text += part(name);
    if (found->second.parts.empty()) return text;
    return text + part("builtin_interfaces/Time");
}

}  // namespace versavis::client
