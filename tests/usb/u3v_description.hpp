// SPDX-License-Identifier: BSD-3-Clause
// What a host learns of a USB3 Vision camera by its USB descriptors.
#pragma once

#include <cstdint>
#include <string>

#include "usbfs_node.hpp"

namespace versavis::test {

constexpr std::uint8_t u3v_control_in = 0x81;
constexpr std::uint8_t u3v_control_out = 0x01;
constexpr std::uint8_t u3v_data_in = 0x82;

/// Two interfaces: control, and one stream.
UsbDescription u3v_description(const std::string& vendor, const std::string& model,
                               const std::string& serial);

}  // namespace versavis::test
