// SPDX-License-Identifier: BSD-3-Clause
// The streams of a service as topics of ROS 1. One thread reads the streams and publishes; the
// service calls of calibrations (set_camera_info) are answered by a thread of roscpp.
#include <camera_info_manager/camera_info_manager.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <image_transport/image_transport.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/MagneticField.h>
#include <sensor_msgs/Temperature.h>
#include <sensor_msgs/TimeReference.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "ros_client/messages.hpp"
#include "ros_client/status_reader.hpp"
#include "ros_client/stream_group.hpp"

namespace versavis {

static void set_time(ros::Time& to, OutputTime time) {
    to.fromNSec(static_cast<std::uint64_t>(std::max<std::int64_t>(time.ns, 0)));
}

}  // namespace versavis

namespace versavis::ros1 {

namespace {

constexpr Duration report_period = seconds(1);
constexpr std::uint32_t queue_depth = 5;
constexpr std::uint32_t imu_queue_depth = 200;

class Node : private ros_client::Sink {
 public:
    Node() : streams_(instance_, wanted_, static_cast<ros_client::Sink&>(*this)) {}

    /// Until the node is shut down. Errors: too many streams.
    Expected<> run();

 private:
    struct Camera {
        Camera(const ros::NodeHandle& handle, const std::string& name, const std::string& url)
            : calibration(handle, name, url) {}

        std::string frame_id;
        camera_info_manager::CameraInfoManager calibration;
        image_transport::CameraPublisher publisher;
    };

    struct Imu {
        std::string frame_id;
        ros::Publisher samples;
        std::optional<ros::Publisher> magnetic_fields;  ///< if the part has them
        std::optional<ros::Publisher> temperatures;
    };

    Expected<> on_stream(const std::string& name, ring::StreamKind kind) override;
    Expected<> on_frame(const std::string& name, const Frame& frame) override;
    Expected<> on_sample(const std::string& name, const ImuSample& sample) override;
    Expected<> on_event(const std::string& name, const Event& event) override;
    void report();

    ros::NodeHandle handle_;
    ros::NodeHandle own_{"~"};
    std::string instance_ = own_.param<std::string>("instance", "default");
    std::vector<std::string> wanted_ = own_.param("streams", std::vector<std::string>());
    image_transport::ImageTransport transport_{handle_};
    std::map<std::string, std::unique_ptr<Camera>> cameras_;
    std::map<std::string, Imu> imus_;
    ros::Publisher utc_ = handle_.advertise<sensor_msgs::TimeReference>("utc", queue_depth);
    ros::Publisher diagnostics_ =
        handle_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", queue_depth);
    ros_client::StreamGroup streams_;
    std::uint64_t overtaken_ = 0;  ///< frames that the service overwrote before they were sent
    std::uint64_t reported_lost_ = 0;
};

Expected<> Node::run() {
    std::optional<HostTime> reported;
    while (ros::ok()) {
        if (auto done = streams_.turn(milliseconds(100)); !done) return done;
        if (const HostTime now = host_now(); !reported || now - *reported >= report_period) {
            reported = now;
            report();
        }
    }
    return {};
}

/// What somebody should know once a second.
void Node::report() {
    constexpr double repeat_s = 30;
    if (const auto& problem = streams_.problem())
        ROS_WARN_STREAM_THROTTLE(repeat_s, problem->message());
    if (const std::uint64_t lost = streams_.lost() + overtaken_; lost > reported_lost_) {
        ROS_WARN_STREAM(lost - reported_lost_ << " items were overwritten before they were read");
        reported_lost_ = lost;
    }
    const auto status = ros_client::read_status(instance_);
    diagnostic_msgs::DiagnosticArray message;
    ros_client::fill_diagnostics(
        message,
        ros_client::diagnostics(instance_, status ? *status : nlohmann::json(),
                                status ? "" : status.error().message()),
        ros_client::time_of_day());
    diagnostics_.publish(message);
}

Expected<> Node::on_stream(const std::string& name, ring::StreamKind kind) {
    const std::string base = ros_client::topic_part(name);
    const auto frame_id = own_.param<std::string>(base + "/frame_id", name);
    if (kind == ring::StreamKind::frames) {
        const auto url = own_.param<std::string>(base + "/camera_info_url", "");
        auto camera = std::make_unique<Camera>(ros::NodeHandle(handle_, base), base, url);
        camera->frame_id = frame_id;
        camera->publisher = transport_.advertiseCamera(base + "/image_raw", queue_depth);
        cameras_[name] = std::move(camera);
    }
    if (kind == ring::StreamKind::imu)
        imus_[name] = {frame_id,
                       handle_.advertise<sensor_msgs::Imu>(base + "/data_raw", imu_queue_depth),
                       std::nullopt, std::nullopt};
    ROS_INFO_STREAM("publishing " << name);
    return {};
}

Expected<> Node::on_frame(const std::string& name, const Frame& frame) {
    Camera& camera = *cameras_.at(name);
    if (camera.publisher.getNumSubscribers() == 0) return {};
    const auto image = boost::make_shared<sensor_msgs::Image>();
    if (!ros_client::fill_image(*image, frame, camera.frame_id)) {
        ++overtaken_;
        return {};
    }
    const auto info = boost::make_shared<sensor_msgs::CameraInfo>();
    // A calibration is of one size of picture.
    const sensor_msgs::CameraInfo calibration = camera.calibration.getCameraInfo();
    if (calibration.width == image->width && calibration.height == image->height)
        *info = calibration;
    info->header = image->header;
    info->width = image->width;
    info->height = image->height;
    camera.publisher.publish(image, info);
    return {};
}

Expected<> Node::on_sample(const std::string& name, const ImuSample& sample) {
    Imu& imu = imus_.at(name);
    const std::string base = ros_client::topic_part(name);
    if (!std::isnan(sample.data.magnetic[0])) {
        if (!imu.magnetic_fields)
            imu.magnetic_fields =
                handle_.advertise<sensor_msgs::MagneticField>(base + "/mag", imu_queue_depth);
        sensor_msgs::MagneticField field;
        ros_client::fill_magnetic_field(field, sample, imu.frame_id);
        imu.magnetic_fields->publish(field);
    }
    if (!std::isnan(sample.data.temperature)) {
        if (!imu.temperatures)
            imu.temperatures =
                handle_.advertise<sensor_msgs::Temperature>(base + "/temperature", imu_queue_depth);
        sensor_msgs::Temperature temperature;
        ros_client::fill_temperature(temperature, sample, imu.frame_id);
        imu.temperatures->publish(temperature);
    }
    sensor_msgs::Imu message;
    ros_client::fill_imu(message, sample, imu.frame_id);
    imu.samples.publish(message);
    return {};
}

Expected<> Node::on_event(const std::string& /*name*/, const Event& event) {
    if (event.data.kind != EventKind::utc_label) return {};
    sensor_msgs::TimeReference reference;
    ros_client::fill_time_reference(reference, event);
    utc_.publish(reference);
    return {};
}

}  // namespace

}  // namespace versavis::ros1

int main(int argc, char** argv) {
    ros::init(argc, argv, "versavis");
    signal(SIGTERM, [](int) { ros::requestShutdown(); });  // as roscpp does at SIGINT
    versavis::ros1::Node node;
    ros::AsyncSpinner services(1);
    services.start();
    if (const auto done = node.run(); !done) {
        ROS_FATAL_STREAM(done.error().message());
        return 1;
    }
    return 0;
}
