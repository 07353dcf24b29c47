// SPDX-License-Identifier: BSD-3-Clause
// Finds a camera by address, MAC, serial number or name, opens it and takes control; says why it
// cannot.
#pragma once

#include <functional>
#include <string>

#include "camera/camera_state.hpp"
#include "camera/genicam.hpp"

namespace versavis::daemon {

/// Blocks for seconds when the camera is not there. Opens one camera at a time: what Aravis knows
/// of devices is shared by all threads. `cancelled` is asked when its turn has come.
CameraResult<Object<ArvCamera>> open_camera(const std::string& device,
                                            const std::function<bool()>& cancelled);

}  // namespace versavis::daemon
