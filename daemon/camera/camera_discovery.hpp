// SPDX-License-Identifier: BSD-3-Clause
// Finds a camera by address, MAC, serial number or name, looks at its description, opens it and
// takes control; says why it cannot.
#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "camera/aravis_node_map.hpp"
#include "camera/camera_state.hpp"
#include "camera/description_sandbox.hpp"
#include "camera/device_locks.hpp"
#include "camera/gvcp.hpp"

namespace versavis::daemon {

struct OpenCamera {
    Object<ArvCamera> camera;
    std::optional<NetworkDevice> network;  ///< none: it is on USB
};

/// What all that open cameras share.
struct CameraOpening {
    DescriptionSandbox& descriptions;
    DeviceLocks& claims;
    std::timed_mutex& aravis;  ///< Aravis parses into one state, and lists USB into another
};

/// Of `camera`, whose configuration names the `device`. Cameras on the network are looked for side
/// by side, and nobody waits for one that is not there. `cancelled` is asked often.
CameraResult<OpenCamera> open_camera(const std::string& camera, const std::string& device,
                                     const CameraOpening& opening, const Cancelled& cancelled);

/// Holds the mutex, unless it is cancelled meanwhile: then owns_lock() is false.
std::unique_lock<std::timed_mutex> lock(std::timed_mutex& mutex, const Cancelled& cancelled);

}  // namespace versavis::daemon
