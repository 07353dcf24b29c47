// SPDX-License-Identifier: BSD-3-Clause
// Finds the cameras that this host can see, sets and controls none of them, and says what would
// keep the service from using one.
#pragma once

#include <string>
#include <vector>

#include "settings/camera_preset.hpp"

namespace versavis::daemon {

enum class Access {
    free,
    busy,         ///< a program controls it: the service, perhaps
    unreachable,  ///< it answers, but its address is not in the subnet of the interface
    denied,       ///< this user may not open it
    silent,       ///< it can be found, and does not answer otherwise
};
const char* to_string(Access access);

struct ListedCamera {
    std::string protocol;  ///< "GigE Vision" or "USB3 Vision"
    std::string device;    ///< by which the configuration names it
    std::string vendor;
    std::string model;
    std::string version;
    std::string serial;
    std::string user_name;
    std::string mac;        ///< on the network, as the next three
    std::string address;    ///< of the camera
    std::string interface;  ///< of this host, at which it answers
    std::string port;       ///< of USB
    std::string preset;     ///< that it would be set up by
    Access access = Access::free;
    std::string problem;  ///< what stands in the way; empty: nothing
    std::string cure;     ///< what to do about it
};

/// Cameras that answer to Aravis, to a broadcast or at one of `addresses`, and all on USB.
Expected<std::vector<ListedCamera>> list_cameras(const std::vector<std::string>& addresses,
                                                 const std::vector<CameraPreset>& presets);

/// The name in the configuration of a camera with this address and serial number: the address,
/// which is found most quickly, unless the camera may have another one next time.
std::string device_name(const std::string& address, const std::string& serial);

/// Marks cameras whose address another one has, too.
void find_shared_addresses(std::vector<ListedCamera>& cameras);

/// For a terminal.
std::string to_text(const std::vector<ListedCamera>& cameras);

/// An array of objects (docs/user/discover.md).
std::string to_json(const std::vector<ListedCamera>& cameras);

}  // namespace versavis::daemon
