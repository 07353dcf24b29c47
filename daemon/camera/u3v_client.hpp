// SPDX-License-Identifier: BSD-3-Clause
// Asks USB3 Vision cameras over their control channel what Aravis takes on trust when it opens
// them. Each call ends in bounded time, whatever the camera sends.
#pragma once

#include <cstdint>
#include <string>

#include "camera/camera_state.hpp"
#include "camera/description.hpp"
#include "device/usb_bus.hpp"

namespace versavis::daemon {

/// What a camera calls itself by its USB descriptors.
struct UsbName {
    std::string vendor;
    std::string model;
    std::string serial;
};

/// Reads the description, and leaves the camera as it was. `device` is for errors: it cannot be
/// opened or does not answer, or its registers make no sense.
CameraResult<Description> read_usb_description(const std::string& device, const UsbName& name,
                                               const Cancelled& cancelled);

/// The control interface of USB3 Vision, by which such cameras are found.
inline constexpr device::UsbClass u3v_control{0xEF, 5, 0};

/// Where bootstrap registers lie: GenCP's, and within those of USB3 Vision and of its stream.
inline constexpr std::uint64_t abrm_sbrm = 0x1D8;
inline constexpr std::uint64_t sbrm_sirm = 0x20;
inline constexpr std::uint64_t sirm_payload = 0x8;

}  // namespace versavis::daemon
