// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_list.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "camera/aravis_node_map.hpp"
#include "camera/gvcp.hpp"
#include "camera/u3v_client.hpp"
#include "device/usb_bus.hpp"

namespace versavis::daemon {

namespace {

using nlohmann::json;

/// Cameras may wait a second with their answer to a broadcast.
constexpr Duration list_broadcast_patience = milliseconds(1200);

constexpr const char* gige = "GigE Vision";
constexpr const char* usb3 = "USB3 Vision";

bool link_local(const std::string& address) { return address.rfind("169.254.", 0) == 0; }

/// An address for this host in the camera's subnet.
std::string address_beside(in_addr camera) {
    constexpr std::uint32_t last = 0xFF;
    const std::uint32_t whole = ntohl(camera.s_addr);
    const std::uint32_t host = (whole & last) == 1 ? 2 : 1;
    const bool local = link_local(to_text(camera));
    return fmt::format("{}/{}", to_text(in_addr{htonl((whole & ~last) | host)}), local ? 16 : 24);
}

void judge_address(const NetworkDevice& found, const OwnInterface& own, ListedCamera& camera) {
    if (own.contains(found.address)) return;
    camera.access = Access::unreachable;
    camera.problem =
        fmt::format("its address {} is not in the subnet of {}", camera.address, own.text());
    camera.cure = fmt::format(
        "add an address in the camera's subnet to this host, 'sudo ip addr add {} dev {}', or give "
        "the camera one in the host's with its maker's tool",
        address_beside(found.address), own.name);
}

/// Asks, and takes no control.
void judge_control(const NetworkDevice& found, ListedCamera& camera) {
    GvcpClient client(found.interface, found.address);
    const auto privilege = client.read_register(gvcp_control_privilege, register_patience);
    if (!privilege) {
        camera.access = Access::silent;
        camera.problem = "it answers when it is looked for, and to no question";
        camera.cure = "check the firewall (UDP port 3956), or power it off and on";
    } else if ((*privilege & gvcp_controlled) != 0) {
        camera.access = Access::busy;
        camera.problem = "another program controls it";
        camera.cure = "close that program";
    }
}

ListedCamera describe(const NetworkDevice& found) {
    ListedCamera camera;
    camera.protocol = gige;
    camera.vendor = found.vendor;
    camera.model = found.model;
    camera.version = found.version;
    camera.serial = found.serial;
    camera.user_name = found.user_name;
    camera.mac = found.mac;
    camera.address = to_text(found.address);
    camera.device = device_name(camera.address, found.serial.empty() ? found.mac : found.serial);
    const auto own = own_interface(found.interface);
    if (own) {
        camera.interface = own->text();
        judge_address(found, *own, camera);
    }
    if (camera.access == Access::free) judge_control(found, camera);
    return camera;
}

bool same(const std::string& a, const std::string& b) {
    return strcasecmp(a.c_str(), b.c_str()) == 0;
}

/// At the interface in whose subnet the camera is, if it answers at several.
void add(std::vector<NetworkDevice>& all, const NetworkDevice& device) {
    const auto known = std::find_if(all.begin(), all.end(), [&](const NetworkDevice& other) {
        return same(other.mac, device.mac);
    });
    if (known == all.end()) return all.push_back(device);
    const auto own = own_interface(device.interface);
    if (own && own->contains(device.address)) *known = device;
}

/// By Aravis' own search, and then by what each says at which interface.
void add_aravis(std::vector<NetworkDevice>& all) {
    ArvInterface* network = arv_gv_interface_get_instance();
    arv_interface_update_device_list(network);
    for (unsigned i = 0; i < arv_interface_get_n_devices(network); ++i) {
        const char* mac = arv_interface_get_device_physical_id(network, i);
        const auto known = std::any_of(all.begin(), all.end(), [&](const NetworkDevice& other) {
            return mac != nullptr && same(other.mac, mac);
        });
        if (known || mac == nullptr) continue;
        if (const auto device =
                DeviceSearch(mac).wait(list_broadcast_patience, [] { return false; }))
            add(all, *device);
    }
}

std::vector<NetworkDevice> find_on_network(const std::vector<std::string>& addresses) {
    std::vector<NetworkDevice> all;
    for (const NetworkDevice& device : DeviceSearch("").collect(list_broadcast_patience))
        add(all, device);
    add_aravis(all);
    for (const std::string& address : addresses)
        if (const auto device = DeviceSearch(address).wait(address_patience, [] { return false; }))
            add(all, *device);
    return all;
}

ListedCamera describe(const device::UsbDevice& device, int control) {
    ListedCamera camera;
    camera.protocol = usb3;
    camera.port = device.port();
    auto handle = device.open();
    if (!handle) {
        const bool denied = handle.error().fault == device::UsbFault::denied;
        camera.access = denied ? Access::denied : Access::silent;
        camera.problem = denied ? "this user may not open it"
                                : fmt::format("it cannot be opened: {}", handle.error().name());
        camera.cure =
            denied ? "join the group 'versavis', or use sudo" : "unplug it and plug it in";
        return camera;
    }
    camera.vendor = handle->manufacturer();
    camera.model = handle->product();
    camera.serial = camera.device = handle->serial().value_or("");
    const auto claimed = handle->claim(control);
    if (claimed) return camera;
    const bool busy = claimed.error().fault == device::UsbFault::busy;
    camera.access = busy ? Access::busy : Access::silent;
    camera.problem = busy ? "another program controls it"
                          : fmt::format("it cannot be used: {}", claimed.error().name());
    camera.cure = busy ? "close that program" : "unplug it and plug it in";
    return camera;
}

std::vector<ListedCamera> find_on_usb() {
    std::vector<ListedCamera> cameras;
    const auto bus = device::UsbBus::open();
    if (!bus) return cameras;  // a host without USB
    for (const device::UsbDevice& device : bus->devices())
        if (const int control = device.function(u3v_control).interface; control >= 0)
            cameras.push_back(describe(device, control));
    return cameras;
}

}  // namespace

const char* to_string(Access access) {
    switch (access) {
        case Access::free: return "free";
        case Access::busy: return "busy";
        case Access::unreachable: return "unreachable";
        case Access::denied: return "denied";
        case Access::silent: return "silent";
    }
    return "unknown";
}

std::string device_name(const std::string& address, const std::string& serial) {
    return link_local(address) && !serial.empty() ? serial : address;
}

void find_shared_addresses(std::vector<ListedCamera>& cameras) {
    for (ListedCamera& camera : cameras) {
        if (camera.address.empty()) continue;
        const auto other = std::find_if(cameras.begin(), cameras.end(), [&](const auto& another) {
            return &another != &camera && another.address == camera.address;
        });
        if (other == cameras.end()) continue;
        camera.access = Access::unreachable;
        camera.problem = fmt::format("the camera with serial number {} has its address {}, too",
                                     other->serial, camera.address);
        camera.cure =
            "connect one at a time, and give each an address of its own with the maker's "
            "tool";
    }
}

Expected<std::vector<ListedCamera>> list_cameras(const std::vector<std::string>& addresses,
                                                 const std::vector<CameraPreset>& presets) {
    for (const std::string& address : addresses)
        if (!parse_address(address))
            return failure(address, "is no IPv4 address", "write it like 192.168.1.20");
    std::vector<ListedCamera> cameras;
    for (const NetworkDevice& device : find_on_network(addresses))
        cameras.push_back(describe(device));
    for (ListedCamera& camera : find_on_usb()) cameras.push_back(std::move(camera));
    std::sort(cameras.begin(), cameras.end(),
              [](const auto& a, const auto& b) { return a.serial < b.serial; });
    find_shared_addresses(cameras);
    for (ListedCamera& camera : cameras) {
        if (camera.model.empty()) continue;
        if (const auto preset = choose_preset(presets, "auto", camera.vendor, camera.model))
            camera.preset = preset->name;
    }
    return cameras;
}

std::string to_text(const std::vector<ListedCamera>& cameras) {
    std::string text;
    for (const ListedCamera& camera : cameras) {
        text += fmt::format("{} {} {}, serial number {}, at {}: {}\n", camera.protocol,
                            camera.vendor, camera.model, camera.serial,
                            camera.address.empty() ? camera.port : camera.address,
                            to_string(camera.access));
        if (!camera.problem.empty()) text += fmt::format("  {}; {}\n", camera.problem, camera.cure);
    }
    return text;
}

std::string to_json(const std::vector<ListedCamera>& cameras) {
    json list = json::array();
    for (const ListedCamera& camera : cameras)
        list.push_back({{"protocol", camera.protocol},
                        {"device", camera.device},
                        {"vendor", camera.vendor},
                        {"model", camera.model},
                        {"version", camera.version},
                        {"serial", camera.serial},
                        {"user_name", camera.user_name},
                        {"mac", camera.mac},
                        {"address", camera.address},
                        {"interface", camera.interface},
                        {"port", camera.port},
                        {"preset", camera.preset},
                        {"access", to_string(camera.access)},
                        {"problem", camera.problem},
                        {"cure", camera.cure}});
    // Names from devices may hold anything; what is no UTF-8 is replaced.
    return list.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace versavis::daemon
