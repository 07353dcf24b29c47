// SPDX-License-Identifier: BSD-3-Clause
#include "recording/ros_messages.hpp"

#include <catch2/catch.hpp>
#include <cstring>

#include "recording/ros_image.hpp"

using namespace versavis;
using namespace versavis::client;

namespace {

const OutputTime ros_stamp{1'700'000'000'123'456'789};

FrameMetadata ros_frame() {
    FrameMetadata frame{};
    frame.width = 1920;
    frame.height = 1200;
    frame.stride = 1920;
    frame.pixel_format = 0x01080001;
    return frame;
}

template <class T>
T message_at(const std::string& message, std::size_t offset) {
    T value;
    std::memcpy(&value, message.data() + offset, sizeof value);
    return value;
}

}  // namespace

TEST_CASE("ros_messages: an image is what other vendors send, byte for byte") {
    const std::string head = ros_image_head(ros_stamp, "cam0", ros_frame(), 2304000);
    CHECK(head.size() + 2304000 == 2304052);  // as CycloneDDS sends it
    const std::string expected(
        "\x00\x01\x00\x00"
        "\x00\xf1\x53\x65\x15\xcd\x5b\x07"
        "\x05\x00\x00\x00"
        "cam0\x00\x00\x00\x00"
        "\xb0\x04\x00\x00\x80\x07\x00\x00"
        "\x06\x00\x00\x00mono8\x00"
        "\x00\x00"
        "\x80\x07\x00\x00\x00\x28\x23\x00",
        52);
    CHECK(head == expected);
    const std::string message = head + std::string(2304000, 'x');
    const auto image = parse_image(std::as_bytes(std::span(message)));
    REQUIRE(image);
    CHECK(image->encoding == "mono8");
    CHECK(image->data.size() == 2304000);
}

TEST_CASE("ros_messages: an IMU sample without orientation") {
    ImuMetadata sample{};
    sample.gyro[2] = 0.5F;
    sample.accel[0] = -9.75F;
    const std::string message = ros_imu(ros_stamp, "imu0", sample);
    CHECK(message.size() == 324);  // as CycloneDDS sends it
    constexpr std::size_t orientation = 4 + 24;
    CHECK(message_at<double>(message, orientation + 24) == 1);
    CHECK(message_at<double>(message, orientation + 32) == -1);
    CHECK(message_at<double>(message, orientation + 8 * (4 + 9 + 2)) == 0.5);
    CHECK(message_at<double>(message, orientation + 8 * (4 + 9 + 3 + 9)) == -9.75);
}

TEST_CASE("ros_messages: a lens stands in CameraInfo, if it is of the frame's size") {
    const RosLens lens{1920, 1200, 900, 901, 960, 600, "plumb_bob", {-0.25, 0.5, 0, 0, 0}};
    const std::string message = ros_camera_info(ros_stamp, "cam0", ros_frame(), &lens);
    const std::size_t d = 4 + 20 + 8 + 4 + 12;
    CHECK(message.substr(36, 10) == std::string("plumb_bob", 10));
    CHECK(message_at<std::uint32_t>(message, d) == 5);
    CHECK(message_at<double>(message, d + 4) == -0.25);
    const std::size_t k = d + 4 + 5 * 8;
    CHECK(message_at<double>(message, k) == 900);
    CHECK(message_at<double>(message, k + 2 * 8) == 960);
    CHECK(message_at<double>(message, k + 4 * 8) == 901);
    CHECK(message_at<double>(message, k + 8 * 8) == 1);
    const std::size_t p = k + 18 * 8;
    CHECK(message_at<double>(message, p - 8) == 1);
    CHECK(message_at<double>(message, p + 6 * 8) == 600);
    CHECK(message_at<double>(message, p + 10 * 8) == 1);
    FrameMetadata other = ros_frame();
    other.width /= 2;
    CHECK(ros_camera_info(ros_stamp, "cam0", other, &lens) ==
          ros_camera_info(ros_stamp, "cam0", other));
    CHECK(ros_camera_info(ros_stamp, "cam0", other).size() == message.size() - 48);
}

TEST_CASE("ros_messages: times before 1970 and their rest") {
    const std::string message = ros_utc(OutputTime{-1}, OutputTime{1'000'000'000});
    CHECK(message_at<std::int32_t>(message, 4) == -1);
    CHECK(message_at<std::uint32_t>(message, 8) == 999'999'999);
}

TEST_CASE("ros_messages: each type is defined with all that it is made of") {
    const std::string imu = ros_definition("sensor_msgs/msg/Imu");
    for (const char* part :
         {"std_msgs/Header header\n", "MSG: std_msgs/Header\n", "MSG: builtin_interfaces/Time\n",
          "MSG: geometry_msgs/Quaternion\n", "MSG: geometry_msgs/Vector3\n", "float64 w 1\n"})
        CHECK_THAT(imu, Catch::Contains(part));
    CHECK(ros_definition("sensor_msgs/msg/Nothing").empty());
}
