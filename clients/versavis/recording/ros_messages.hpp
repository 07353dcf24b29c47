// SPDX-License-Identifier: BSD-3-Clause
// Frames and IMU samples as messages of ROS 2, in CDR, and the definitions of those.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "versavis/metadata.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// sensor_msgs/msg/Image up to its pixels, of which `length` bytes follow.
std::string ros_image_head(OutputTime time, std::string_view stream, const FrameMetadata& frame,
                           std::uint32_t length);

/// sensor_msgs/msg/CompressedImage up to its data, of which `length` bytes follow.
std::string ros_compressed_head(OutputTime time, std::string_view stream, std::string_view format,
                                std::uint32_t length);

/// The same of a PNG.
std::string ros_png_head(OutputTime time, std::string_view stream, const FrameMetadata& frame,
                         std::uint32_t length);

/// What a CameraInfo says of a lens: a pinhole, and its distortion by a name of ROS.
struct RosLens {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    double fx = 0;
    double fy = 0;
    double cx = 0;
    double cy = 0;
    std::string distortion;
    std::vector<double> coefficients;
};

/// sensor_msgs/msg/CameraInfo; without a lens, or with one of another size than the frame, that of
/// a camera that nobody has calibrated.
std::string ros_camera_info(OutputTime time, std::string_view stream, const FrameMetadata& frame,
                            const RosLens* lens = nullptr);

/// sensor_msgs/msg/Imu.
std::string ros_imu(OutputTime time, std::string_view stream, const ImuMetadata& sample);

/// sensor_msgs/msg/MagneticField.
std::string ros_magnetic_field(OutputTime time, std::string_view stream, const ImuMetadata& sample);

/// sensor_msgs/msg/Temperature.
std::string ros_temperature(OutputTime time, std::string_view stream, const ImuMetadata& sample);

/// nmea_msgs/msg/Sentence, without the end of the line.
std::string ros_sentence(OutputTime time, std::string_view stream, std::string_view text);

/// sensor_msgs/msg/TimeReference: the PPS pulse at `time` was named `utc`.
std::string ros_utc(OutputTime time, OutputTime utc);

/// Definition of one of these types, such as `sensor_msgs/msg/Image`, with all that it is made of:
/// MCAP's schema encoding `ros2msg`.
std::string ros_definition(std::string_view type);

}  // namespace versavis::client
