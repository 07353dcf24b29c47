// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_discovery.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <strings.h>

#include <memory>
#include <mutex>
#include <optional>

namespace versavis::daemon {

namespace {

struct Listed {
    std::string id;
    std::string address;
};

std::string text(const char* value) { return value == nullptr ? "" : value; }

std::optional<in_addr> parse_address(const std::string& device) {
    in_addr address{};
    return inet_pton(AF_INET, device.c_str(), &address) == 1 ? std::optional(address)
                                                             : std::nullopt;
}

/// Does this host have an interface in the network of the address?
bool in_own_network(in_addr address) {
    ifaddrs* all = nullptr;
    if (getifaddrs(&all) != 0) return true;
    const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(all, &freeifaddrs);
    for (const ifaddrs* entry = all; entry != nullptr; entry = entry->ifa_next) {
        if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET ||
            entry->ifa_netmask == nullptr)
            continue;
        const auto own = reinterpret_cast<const sockaddr_in*>(entry->ifa_addr)->sin_addr.s_addr;
        const auto mask = reinterpret_cast<const sockaddr_in*>(entry->ifa_netmask)->sin_addr.s_addr;
        if ((own & mask) == (address.s_addr & mask)) return true;
    }
    return false;
}

/// The listed device that goes by this id, serial number, MAC or address.
std::optional<Listed> find_listed(const std::string& device) {
    for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
        const Listed listed{text(arv_get_device_id(i)), text(arv_get_device_address(i))};
        for (const std::string& name : {listed.id, text(arv_get_device_serial_nbr(i)),
                                        text(arv_get_device_physical_id(i)), listed.address})
            if (strcasecmp(name.c_str(), device.c_str()) == 0) return listed;
    }
    return std::nullopt;
}

CameraProblem explain(const std::string& device, const std::optional<Listed>& listed,
                      const std::string& reason) {
    const auto address = parse_address(listed ? listed->address : device);
    if (address && !in_own_network(*address))
        return {CameraState::unreachable,
                {device,
                 fmt::format("its address {} is not in any network of this host",
                             listed ? listed->address : device),
                 "give the camera an address of this host's camera network, or the host one of the "
                 "camera's"}};
    if (reason.find("BUSY") != std::string::npos || reason.find("usy") != std::string::npos)
        return {CameraState::busy, {device, "another program holds it", "close that program"}};
    if (listed)
        return {CameraState::failed,
                {device, "it is there but cannot be opened: " + reason,
                 "USB: check the udev rule; GigE: the firewall; else power it off and on"}};
    return {CameraState::absent,
            {device, "no such camera: " + reason,
             "check cable, power and name ('arv-tool-0.8' lists cameras by address, serial number "
             "and name)"}};
}

}  // namespace

const char* to_string(CameraState state) {
    switch (state) {
        case CameraState::absent: return "absent";
        case CameraState::unreachable: return "unreachable";
        case CameraState::busy: return "busy";
        case CameraState::misconfigured: return "misconfigured";
        case CameraState::opening: return "opening";
        case CameraState::streaming: return "streaming";
        case CameraState::silent: return "silent";
        case CameraState::failed: return "failed";
    }
    return "unknown";
}

CameraResult<Object<ArvCamera>> open_camera(const std::string& device,
                                            const std::function<bool()>& cancelled) {
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    if (cancelled()) return problem(CameraState::absent, {device, "the search was stopped", ""});
    std::optional<Listed> listed;
    if (!parse_address(device)) {
        // USB is listed at once; the network takes a second, and knows a camera's own name without
        // being listed.
        arv_interface_update_device_list(arv_uv_interface_get_instance());
        listed = find_listed(device);
        if (!listed) {
            arv_update_device_list();
            listed = find_listed(device);
        }
    }
    GlibError error;
    Object<ArvCamera> camera(
        arv_camera_new(listed ? listed->id.c_str() : device.c_str(), error.out()));
    if (!camera) return Unexpected(explain(device, listed, error.text()));
    ArvDevice* raw = arv_camera_get_device(camera.get());
    if (ARV_IS_GV_DEVICE(raw) && arv_gv_device_is_controller(ARV_GV_DEVICE(raw)) == FALSE)
        return problem(CameraState::busy,
                       {device, "is controlled by another program", "close that program"});
    return camera;
}

}  // namespace versavis::daemon
