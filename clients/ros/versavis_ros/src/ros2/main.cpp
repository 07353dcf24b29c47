// SPDX-License-Identifier: BSD-3-Clause
#include <rclcpp/rclcpp.hpp>

#include "ros2/node.hpp"

int main(int argc, char** argv) {
    rclcpp::init(argc, argv);
    rclcpp::executors::SingleThreadedExecutor executor;
    const auto node = std::make_shared<versavis::ros2::Node>(rclcpp::NodeOptions());
    executor.add_node(node->get_node_base_interface());
    executor.spin();
    rclcpp::shutdown();
}
