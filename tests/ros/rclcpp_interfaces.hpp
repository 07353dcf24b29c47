// SPDX-License-Identifier: BSD-3-Clause
// What the node of ROS 2 uses of rclcpp, declared as the documentation of Jazzy has it, to compile
// the node where there is no ROS 2. It shows that the node is C++ which fits these declarations,
// and nothing of how it runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace rclcpp {

class QoS {
 public:
    explicit QoS(std::size_t history_depth);
};

struct QosOverridingOptions {
    static QosOverridingOptions with_default_policies();
};

struct PublisherOptions {
    QosOverridingOptions qos_overriding_options;
};

class PublisherBase {
 public:
    std::size_t get_subscription_count() const;
};

class NodeOptions {};

class Parameter {
 public:
    std::string as_string() const;
    std::vector<std::string> as_string_array() const;
};

class Logger {};

class Clock {
 public:
    using SharedPtr = std::shared_ptr<Clock>;
};

namespace node_interfaces {
class NodeBaseInterface {
 public:
    using SharedPtr = std::shared_ptr<NodeBaseInterface>;
};
}  // namespace node_interfaces

namespace executors {
class SingleThreadedExecutor {
 public:
    void add_node(node_interfaces::NodeBaseInterface::SharedPtr node, bool notify = true);
    void spin();
};
}  // namespace executors

void init(int argc, char const* const* argv);
bool shutdown();
bool ok();

}  // namespace rclcpp

namespace rclcpp_lifecycle {

class State {};

template <class Message>
class LifecyclePublisher : public rclcpp::PublisherBase {
 public:
    using SharedPtr = std::shared_ptr<LifecyclePublisher>;
    void on_activate();
    void publish(std::unique_ptr<Message> message);
    void publish(const Message& message);
};

namespace node_interfaces {
class LifecycleNodeInterface {
 public:
    enum class CallbackReturn : std::uint8_t { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
    virtual ~LifecycleNodeInterface() = default;
    virtual CallbackReturn on_configure(const State& previous_state);
    virtual CallbackReturn on_cleanup(const State& previous_state);
    virtual CallbackReturn on_shutdown(const State& previous_state);
    virtual CallbackReturn on_activate(const State& previous_state);
    virtual CallbackReturn on_deactivate(const State& previous_state);
};
}  // namespace node_interfaces

class LifecycleNode : public node_interfaces::LifecycleNodeInterface {
 public:
    LifecycleNode(const std::string& node_name, const rclcpp::NodeOptions& options);

    template <class Value>
    Value declare_parameter(const std::string& name, const Value& default_value);
    bool has_parameter(const std::string& name) const;
    rclcpp::Parameter get_parameter(const std::string& name) const;
    template <class Message>
    std::shared_ptr<LifecyclePublisher<Message>> create_publisher(
        const std::string& topic, const rclcpp::QoS& qos, const rclcpp::PublisherOptions& options);
    rclcpp::Logger get_logger() const;
    rclcpp::Clock::SharedPtr get_clock();
    rclcpp::node_interfaces::NodeBaseInterface::SharedPtr get_node_base_interface();
    const State& configure();
    const State& activate();

    CallbackReturn on_activate(const State& previous_state) override;
    CallbackReturn on_deactivate(const State& previous_state) override;
};

}  // namespace rclcpp_lifecycle

// Their arguments are checked as those of printf.
__attribute__((format(printf, 2, 3))) void log_text(const rclcpp::Logger& logger,
                                                    const char* format, ...);
#define RCLCPP_INFO(logger, ...) log_text(logger, __VA_ARGS__)
#define RCLCPP_WARN(logger, ...) log_text(logger, __VA_ARGS__)
#define RCLCPP_ERROR(logger, ...) log_text(logger, __VA_ARGS__)
#define RCLCPP_FATAL(logger, ...) log_text(logger, __VA_ARGS__)
#define RCLCPP_WARN_THROTTLE(logger, clock, duration, ...) \
    ((void)(clock), (void)(duration), log_text(logger, __VA_ARGS__))
#define RCLCPP_COMPONENTS_REGISTER_NODE(NodeClass)                              \
    static_assert(std::is_constructible<NodeClass, rclcpp::NodeOptions>::value, \
                  "a component is made of NodeOptions");
