// SPDX-License-Identifier: BSD-3-Clause
// What a camera may be called by in the configuration: address, MAC address, serial number or name.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace versavis::daemon {

/// The MAC address as aa:bb:cc:dd:ee:ff, whichever way it is written; none: it is no MAC address.
std::optional<std::string> mac_address(std::string_view text);

/// Two ways of writing one name.
bool same_device(const std::string& a, const std::string& b);

struct DeviceFault {
    std::string what;  ///< follows the name
    std::string cure;
};

/// Why no camera can be found by this name; none: one may be.
std::optional<DeviceFault> device_fault(const std::string& device);

}  // namespace versavis::daemon
