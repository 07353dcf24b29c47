// SPDX-License-Identifier: BSD-3-Clause
#include "ros2/node.hpp"

#include <unistd.h>

#include <camera_calibration_parsers/parse.hpp>
#include <cmath>
#include <rclcpp_components/register_node_macro.hpp>
#include <utility>

#include "ros2/versavis_messages.hpp"
#include "ros_client/messages.hpp"
#include "ros_client/status_reader.hpp"
#include "ros_client/sync_graph.hpp"

namespace versavis {

static void set_time(builtin_interfaces::msg::Time& to, OutputTime time) {
    constexpr std::int64_t second = 1'000'000'000;
    const std::int64_t rest = (time.ns % second + second) % second;
    to.sec = static_cast<std::int32_t>((time.ns - rest) / second);
    to.nanosec = static_cast<std::uint32_t>(rest);
}

}  // namespace versavis

namespace versavis::ros2 {

namespace {

constexpr Duration report_period = seconds(1);
constexpr std::size_t queue_depth = 5;
constexpr std::size_t imu_queue_depth = 200;

bool is_read(const rclcpp::PublisherBase& publisher) {
    return publisher.get_subscription_count() > 0;
}

std::string host_name() {
    char name[256] = {};
    gethostname(name, sizeof name - 1);
    return name;
}

}  // namespace

Node::Node(const rclcpp::NodeOptions& options)
    : rclcpp_lifecycle::LifecycleNode("versavis", options) {
    declare_parameter("instance", std::string("default"));
    declare_parameter("streams", std::vector<std::string>());
    declare_parameter("sync_diagnostics.topic", std::string());
    if (!declare_parameter("autostart", true)) return;
    configure();
    activate();
}

Node::~Node() { stop(); }

Node::Result Node::on_configure(const rclcpp_lifecycle::State& /*state*/) {
    instance_ = get_parameter("instance").as_string();
    diagnostics_ = publisher<diagnostic_msgs::msg::DiagnosticArray>("/diagnostics", queue_depth);
    if (const auto topic = get_parameter("sync_diagnostics.topic").as_string(); !topic.empty())
        graph_ = publisher<std_msgs::msg::UInt8MultiArray>(topic, queue_depth);
    return Result::SUCCESS;
}

Node::Result Node::on_activate(const rclcpp_lifecycle::State& state) {
    LifecycleNode::on_activate(state);
    // What was published while the node was inactive is nobody's.
    streams_.emplace(instance_, get_parameter("streams").as_string_array(),
                     static_cast<ros_client::Sink&>(*this));
    overtaken_ = reported_lost_ = 0;
    stop_requested_ = false;
    thread_ = std::thread(&Node::run, this);
    return Result::SUCCESS;
}

Node::Result Node::on_deactivate(const rclcpp_lifecycle::State& state) {
    stop();
    return LifecycleNode::on_deactivate(state);
}

Node::Result Node::on_cleanup(const rclcpp_lifecycle::State& /*state*/) {
    streams_.reset();
    cameras_.clear();
    imus_.clear();
    events_.reset();
    utc_.reset();
    diagnostics_.reset();
    graph_.reset();
    return Result::SUCCESS;
}

Node::Result Node::on_shutdown(const rclcpp_lifecycle::State& state) {
    stop();
    return on_cleanup(state);
}

void Node::stop() {
    stop_requested_ = true;
    if (thread_.joinable()) thread_.join();
}

void Node::run() {
    const auto end = [this](const std::string& why) {
        RCLCPP_FATAL(get_logger(), "%s; deactivate and activate the node to go on", why.c_str());
    };
    try {
        std::optional<HostTime> reported;
        while (!stop_requested_) {
            if (const auto done = streams_->turn(milliseconds(100)); !done)
                return end(done.error().message());
            if (const HostTime now = host_now(); !reported || now - *reported >= report_period) {
                reported = now;
                report();
            }
        }
    } catch (const std::exception& error) {  // of rclcpp: a parameter of another type, ...
        if (rclcpp::ok()) end(error.what());
    }
}

/// What somebody should know once a second.
void Node::report() {
    constexpr int repeat_ms = 30'000;
    if (const auto& problem = streams_->problem())
        RCLCPP_WARN_THROTTLE(get_logger(), *get_clock(), repeat_ms, "%s",
                             problem->message().c_str());
    if (const std::uint64_t lost = streams_->lost() + overtaken_; lost > reported_lost_) {
        RCLCPP_WARN(get_logger(), "%llu items were overwritten before they were read",
                    static_cast<unsigned long long>(lost - reported_lost_));
        reported_lost_ = lost;
    }
    const auto status = ros_client::read_status(instance_);
    diagnostic_msgs::msg::DiagnosticArray message;
    ros_client::fill_diagnostics(
        message,
        ros_client::diagnostics(instance_, status ? *status : nlohmann::json(),
                                status ? "" : status.error().message()),
        ros_client::time_of_day());
    diagnostics_->publish(message);
    if (!graph_ || !status) return;
    for (const std::string& update :
         ros_client::graph_updates(host_name(), *status, ros_client::read_clocks())) {
        std_msgs::msg::UInt8MultiArray bytes;
        bytes.data.assign(update.begin(), update.end());
        graph_->publish(bytes);
    }
}

std::string Node::parameter(const std::string& name, const std::string& otherwise) {
    if (!has_parameter(name)) declare_parameter(name, otherwise);
    return get_parameter(name).as_string();
}

/// Publishes as nodes do that nobody has configured; qos_overrides parameters change it.
template <class Message>
Node::Publisher<Message> Node::publisher(const std::string& topic, std::size_t depth) {
    rclcpp::PublisherOptions options;
    options.qos_overriding_options = rclcpp::QosOverridingOptions::with_default_policies();
    auto made = create_publisher<Message>(topic, rclcpp::QoS(depth), options);
    made->on_activate();  // only the thread of an active node publishes
    return made;
}

/// A file as camera_calibration writes it. Without one, the message says "not calibrated".
void Node::read_calibration(const std::string& name, Camera& camera) {
    std::string path = parameter(name + ".camera_info_url", "");
    if (path.empty()) return;
    constexpr const char* scheme = "file://";
    if (path.rfind(scheme, 0) == 0) path = path.substr(std::string(scheme).size());
    std::string camera_name;
    if (!camera_calibration_parsers::readCalibration(path, camera_name, camera.info)) {
        camera.info = sensor_msgs::msg::CameraInfo();
        RCLCPP_ERROR(get_logger(),
                     "%s.camera_info_url: %s is no calibration; give a file of camera_calibration",
                     name.c_str(), path.c_str());
    }
}

Expected<> Node::on_stream(const std::string& name, ring::StreamKind kind) {
    const std::string base = ros_client::topic_part(name);
    if (cameras_.count(name) + imus_.count(name) > 0) return {};  // from before it was inactive
    if (kind == ring::StreamKind::frames) {
        Camera& camera = cameras_[name];
        camera.frame_id = parameter(name + ".frame_id", name);
        read_calibration(name, camera);
        camera.images = publisher<sensor_msgs::msg::Image>(base + "/image_raw", queue_depth);
        camera.infos = publisher<sensor_msgs::msg::CameraInfo>(base + "/camera_info", queue_depth);
        camera.stamps = publisher<versavis_msgs::msg::Stamp>(base + "/stamp", queue_depth);
    }
    if (kind == ring::StreamKind::imu) {
        Imu& imu = imus_[name];
        imu.frame_id = parameter(name + ".frame_id", name);
        imu.samples = publisher<sensor_msgs::msg::Imu>(base + "/data_raw", imu_queue_depth);
    }
    if (kind == ring::StreamKind::events && !events_) {
        events_ = publisher<versavis_msgs::msg::Event>("events", queue_depth);
        utc_ = publisher<sensor_msgs::msg::TimeReference>("utc", queue_depth);
    }
    RCLCPP_INFO(get_logger(), "publishing %s", name.c_str());
    return {};
}

Expected<> Node::on_frame(const std::string& name, const Frame& frame) {
    Camera& camera = cameras_.at(name);
    const OutputTime time = frame.time.output();
    if (is_read(*camera.images)) {
        auto image = std::make_unique<sensor_msgs::msg::Image>();
        if (!ros_client::fill_image(*image, frame, camera.frame_id)) {
            ++overtaken_;
            return {};
        }
        camera.images->publish(std::move(image));
    }
    if (is_read(*camera.infos)) {
        auto info = std::make_unique<sensor_msgs::msg::CameraInfo>();
        // A calibration is of one size of picture.
        if (camera.info.width == frame.data.width && camera.info.height == frame.data.height)
            *info = camera.info;
        ros_client::fill_header(*info, time, camera.frame_id);
        info->width = frame.data.width;
        info->height = frame.data.height;
        camera.infos->publish(std::move(info));
    }
    if (is_read(*camera.stamps)) {
        auto stamp = std::make_unique<versavis_msgs::msg::Stamp>();
        fill_stamp(*stamp, frame, camera.frame_id);
        camera.stamps->publish(std::move(stamp));
    }
    return {};
}

Expected<> Node::on_sample(const std::string& name, const ImuSample& sample) {
    Imu& imu = imus_.at(name);
    const std::string base = ros_client::topic_part(name);
    if (!std::isnan(sample.data.magnetic[0])) {
        if (!imu.magnetic_fields)
            imu.magnetic_fields =
                publisher<sensor_msgs::msg::MagneticField>(base + "/mag", imu_queue_depth);
        sensor_msgs::msg::MagneticField field;
        ros_client::fill_magnetic_field(field, sample, imu.frame_id);
        imu.magnetic_fields->publish(field);
    }
    if (!std::isnan(sample.data.temperature)) {
        if (!imu.temperatures)
            imu.temperatures =
                publisher<sensor_msgs::msg::Temperature>(base + "/temperature", imu_queue_depth);
        sensor_msgs::msg::Temperature temperature;
        ros_client::fill_temperature(temperature, sample, imu.frame_id);
        imu.temperatures->publish(temperature);
    }
    auto message = std::make_unique<sensor_msgs::msg::Imu>();
    ros_client::fill_imu(*message, sample, imu.frame_id);
    imu.samples->publish(std::move(message));
    return {};
}

Expected<> Node::on_event(const std::string& name, const Event& event) {
    versavis_msgs::msg::Event message;
    fill_event(message, event, name);
    events_->publish(message);
    if (event.data.kind != EventKind::utc_label) return {};
    sensor_msgs::msg::TimeReference reference;
    ros_client::fill_time_reference(reference, event);
    utc_->publish(reference);
    return {};
}

}  // namespace versavis::ros2

RCLCPP_COMPONENTS_REGISTER_NODE(versavis::ros2::Node)
