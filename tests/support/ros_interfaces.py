# SPDX-License-Identifier: BSD-3-Clause
"""Messages of ROS 2 as their interfaces are documented: each with all that it is made of."""

HEADER = {"std_msgs/msg/Header": "stamp builtin_interfaces/msg/Time, frame_id string",
          "builtin_interfaces/msg/Time": "sec int32, nanosec uint32"}
VECTORS = {"geometry_msgs/msg/Vector3": "x float64, y float64, z float64",
           "geometry_msgs/msg/Quaternion": "x float64, y float64, z float64, w float64"}
INTERFACES = {
    "sensor_msgs/msg/Image": {
        "sensor_msgs/msg/Image": "header std_msgs/msg/Header, height uint32, width uint32, "
        "encoding string, is_bigendian uint8, step uint32, data uint8[]", **HEADER},
    "sensor_msgs/msg/CameraInfo": {
        "sensor_msgs/msg/CameraInfo": "header std_msgs/msg/Header, height uint32, width uint32, "
        "distortion_model string, d float64[], k float64[9], r float64[9], p float64[12], "
        "binning_x uint32, binning_y uint32, roi sensor_msgs/msg/RegionOfInterest",
        "sensor_msgs/msg/RegionOfInterest": "x_offset uint32, y_offset uint32, height uint32, "
        "width uint32, do_rectify bool", **HEADER},
    "sensor_msgs/msg/Imu": {
        "sensor_msgs/msg/Imu": "header std_msgs/msg/Header, "
        "orientation geometry_msgs/msg/Quaternion, orientation_covariance float64[9], "
        "angular_velocity geometry_msgs/msg/Vector3, angular_velocity_covariance float64[9], "
        "linear_acceleration geometry_msgs/msg/Vector3, "
        "linear_acceleration_covariance float64[9]", **HEADER, **VECTORS},
    "sensor_msgs/msg/TimeReference": {
        "sensor_msgs/msg/TimeReference": "header std_msgs/msg/Header, "
        "time_ref builtin_interfaces/msg/Time, source string", **HEADER},
    "sensor_msgs/msg/Temperature": {
        "sensor_msgs/msg/Temperature": "header std_msgs/msg/Header, temperature float64, "
        "variance float64", **HEADER},
    "sensor_msgs/msg/MagneticField": {
        "sensor_msgs/msg/MagneticField": "header std_msgs/msg/Header, "
        "magnetic_field geometry_msgs/msg/Vector3, magnetic_field_covariance float64[9]",
        **HEADER, **VECTORS},
    "sensor_msgs/msg/CompressedImage": {
        "sensor_msgs/msg/CompressedImage": "header std_msgs/msg/Header, format string, "
        "data uint8[]", **HEADER},
    "nmea_msgs/msg/Sentence": {
        "nmea_msgs/msg/Sentence": "header std_msgs/msg/Header, sentence string", **HEADER},
    "diagnostic_msgs/msg/DiagnosticArray": {
        "diagnostic_msgs/msg/DiagnosticArray": "header std_msgs/msg/Header, "
        "status diagnostic_msgs/msg/DiagnosticStatus[]",
        "diagnostic_msgs/msg/DiagnosticStatus": "level byte, name string, message string, "
        "hardware_id string, values diagnostic_msgs/msg/KeyValue[]",
        "diagnostic_msgs/msg/KeyValue": "key string, value string", **HEADER},
}
