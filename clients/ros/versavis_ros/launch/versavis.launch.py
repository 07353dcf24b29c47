# SPDX-License-Identifier: BSD-3-Clause
"""The node in a container of its own, beside which other components get images without a copy."""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import ComposableNodeContainer
from launch_ros.descriptions import ComposableNode


def generate_launch_description():
    node = ComposableNode(
        package="versavis_ros", plugin="versavis::ros2::Node", name="versavis",
        namespace=LaunchConfiguration("namespace"),
        parameters=[{"instance": LaunchConfiguration("instance")}],
        extra_arguments=[{"use_intra_process_comms": True}])
    return LaunchDescription([
        DeclareLaunchArgument("namespace", default_value=""),
        DeclareLaunchArgument("instance", default_value="default"),
        ComposableNodeContainer(
            package="rclcpp_components", executable="component_container",
            name="versavis_container", namespace=LaunchConfiguration("namespace"),
            composable_node_descriptions=[node], output="screen")])
