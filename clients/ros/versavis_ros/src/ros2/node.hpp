// SPDX-License-Identifier: BSD-3-Clause
// The streams of a service as topics of ROS 2: a component with a lifecycle. While it is active, a
// thread of its own reads the streams and publishes; all else happens in callbacks of its executor.
#pragma once

#include <atomic>
#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <map>
#include <memory>
#include <optional>
#include <rclcpp_lifecycle/lifecycle_node.hpp>
#include <rclcpp_lifecycle/lifecycle_publisher.hpp>
#include <sensor_msgs/msg/camera_info.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <sensor_msgs/msg/imu.hpp>
#include <sensor_msgs/msg/magnetic_field.hpp>
#include <sensor_msgs/msg/temperature.hpp>
#include <sensor_msgs/msg/time_reference.hpp>
#include <std_msgs/msg/u_int8_multi_array.hpp>
#include <string>
#include <thread>
#include <versavis_msgs/msg/event.hpp>
#include <versavis_msgs/msg/stamp.hpp>

#include "ros_client/stream_group.hpp"

namespace versavis::ros2 {

class Node : public rclcpp_lifecycle::LifecycleNode, private ros_client::Sink {
 public:
    explicit Node(const rclcpp::NodeOptions& options);
    ~Node() override;

    using Result = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;
    Result on_configure(const rclcpp_lifecycle::State& state) override;
    Result on_activate(const rclcpp_lifecycle::State& state) override;
    Result on_deactivate(const rclcpp_lifecycle::State& state) override;
    Result on_cleanup(const rclcpp_lifecycle::State& state) override;
    Result on_shutdown(const rclcpp_lifecycle::State& state) override;

 private:
    template <class Message>
    using Publisher = typename rclcpp_lifecycle::LifecyclePublisher<Message>::SharedPtr;

    struct Camera {
        std::string frame_id;
        sensor_msgs::msg::CameraInfo info;  ///< of its calibration; zeros: none
        Publisher<sensor_msgs::msg::Image> images;
        Publisher<sensor_msgs::msg::CameraInfo> infos;
        Publisher<versavis_msgs::msg::Stamp> stamps;
    };

    struct Imu {
        std::string frame_id;
        Publisher<sensor_msgs::msg::Imu> samples;
        Publisher<sensor_msgs::msg::MagneticField> magnetic_fields;  ///< if the part has them
        Publisher<sensor_msgs::msg::Temperature> temperatures;
    };

    Expected<> on_stream(const std::string& name, ring::StreamKind kind) override;
    Expected<> on_frame(const std::string& name, const Frame& frame) override;
    Expected<> on_sample(const std::string& name, const ImuSample& sample) override;
    Expected<> on_event(const std::string& name, const Event& event) override;

    void run();
    void stop();
    void report();
    std::string parameter(const std::string& name, const std::string& otherwise);
    void read_calibration(const std::string& name, Camera& camera);
    template <class Message>
    Publisher<Message> publisher(const std::string& topic, std::size_t depth);

    std::string instance_;
    std::optional<ros_client::StreamGroup> streams_;
    std::map<std::string, Camera> cameras_;
    std::map<std::string, Imu> imus_;
    Publisher<versavis_msgs::msg::Event> events_;
    Publisher<sensor_msgs::msg::TimeReference> utc_;
    Publisher<diagnostic_msgs::msg::DiagnosticArray> diagnostics_;
    Publisher<std_msgs::msg::UInt8MultiArray> graph_;  ///< if it is wanted
    std::uint64_t overtaken_ = 0;  ///< frames that the service overwrote before they were sent
    std::uint64_t reported_lost_ = 0;
    std::thread thread_;
    std::atomic<bool> stop_requested_{false};
};

}  // namespace versavis::ros2
