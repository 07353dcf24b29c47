// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_discovery.hpp"

#include <fmt/format.h>
#include <strings.h>

#include <chrono>

#include "camera/u3v_client.hpp"

namespace versavis::daemon {

namespace {

/// The same for one that is asked by broadcast, before USB is looked at, and after: cameras may
/// wait a second with their answer.
constexpr Duration first_broadcast_patience = milliseconds(100);
constexpr Duration broadcast_patience = seconds(1);

std::string text(const char* value) { return value == nullptr ? "" : value; }

CameraProblem absent(const std::string& device) {
    const auto address = parse_address(device);
    if (address && !in_own_network(*address))
        return {
            CameraState::unreachable,
            {device,
             fmt::format("no interface of this host is in the subnet of its address {}", device),
             "give the camera an address in this host's camera network, or the host one in the "
             "camera's"}};
    return {CameraState::absent,
            {device, "no camera answers to this name",
             "check cable, power and name ('versavis discover' lists cameras by address, serial "
             "number and name; host names are not looked up)"}};
}

CameraResult<> check_claim(const std::string& camera, const std::string& device,
                           const std::string& identity, DeviceLocks& claims) {
    const std::string holder = claims.claim(camera, identity);
    if (holder.empty()) return {};
    return problem(CameraState::misconfigured,
                   {device, fmt::format("is the device of '{}' already", holder),
                    "give each camera of the configuration a 'device' of its own"});
}

Object<GInetAddress> glib_address(in_addr address) {
    return Object<GInetAddress>(g_inet_address_new_from_bytes(
        reinterpret_cast<const guint8*>(&address), G_SOCKET_FAMILY_IPV4));
}

/// Its features may be looked at only now that the description is known to be good.
CameraResult<Object<ArvCamera>> camera_of(const std::string& device, Object<ArvDevice> opened) {
    GlibError error;
    Object<ArvCamera> camera(arv_camera_new_with_device(opened.get(), error.out()));
    if (camera) return camera;
    return problem(CameraState::failed,
                   {device, "cannot be opened: " + error.text(), "power it off and on"});
}

CameraResult<OpenCamera> open_on_network(const std::string& camera, const std::string& device,
                                         const NetworkDevice& found, const CameraOpening& opening,
                                         const Cancelled& cancelled) {
    if (!in_own_network(found.address)) return Unexpected(absent(to_text(found.address)));
    if (auto free = check_claim(camera, device, to_text(found.address), opening.claims); !free)
        return Unexpected(free.error());
    GvcpClient client(found.interface, found.address);
    const auto held = problem(CameraState::busy,
                              {device, "is controlled by another program", "close that program"});
    const auto privilege = client.read_register(gvcp_control_privilege, register_patience);
    if (privilege && (*privilege & gvcp_controlled) != 0) return held;
    const auto description = read_description(client, cancelled);
    if (!description) return problem(CameraState::failed, description.error());
    if (auto good = opening.descriptions.vet(device, *description, cancelled); !good)
        return problem(CameraState::failed, good.error());
    const auto turn = lock(opening.aravis, cancelled);
    if (!turn.owns_lock()) return Unexpected(absent(device));
    GlibError error;
    Object<ArvDevice> opened(arv_gv_device_new(glib_address(found.interface).get(),
                                               glib_address(found.address).get(), error.out()));
    if (!opened)
        return problem(CameraState::failed,
                       {device, "it was found but cannot be opened: " + error.text(),
                        "check the firewall, or power it off and on"});
    if (arv_gv_device_is_controller(ARV_GV_DEVICE(opened.get())) == FALSE) return held;
    auto own = camera_of(device, std::move(opened));
    if (!own) return Unexpected(own.error());
    return OpenCamera{std::move(*own), found};
}

struct UsbDevice {
    std::string id;  ///< Aravis' word for it
    UsbName name;
};

/// The listed device that goes by this id, serial number or GUID. Asks each device.
std::optional<UsbDevice> find_on_usb(const std::string& device) {
    ArvInterface* usb = arv_uv_interface_get_instance();
    arv_interface_update_device_list(usb);
    for (unsigned i = 0; i < arv_interface_get_n_devices(usb); ++i) {
        UsbDevice found{text(arv_interface_get_device_id(usb, i)),
                        {text(arv_interface_get_device_vendor(usb, i)),
                         text(arv_interface_get_device_model(usb, i)),
                         text(arv_interface_get_device_serial_nbr(usb, i))}};
        for (const std::string& name :
             {found.id, found.name.serial, text(arv_interface_get_device_physical_id(usb, i))})
            if (strcasecmp(name.c_str(), device.c_str()) == 0) return found;
    }
    return std::nullopt;
}

CameraResult<Object<ArvDevice>> open_usb_device(const std::string& device, const UsbDevice& found) {
    GlibError error;
    Object<ArvDevice> opened(
        arv_interface_open_device(arv_uv_interface_get_instance(), found.id.c_str(), error.out()));
    if (opened) return opened;
    if (error.text().find("usy") != std::string::npos)
        return problem(CameraState::busy,
                       {device, "another program holds it", "close that program"});
    return problem(CameraState::failed,
                   {device, "it was found but cannot be opened: " + error.text(),
                    "check the udev rule, or unplug it and plug it in"});
}

/// None: it is not on USB.
std::optional<CameraResult<OpenCamera>> open_on_usb(const std::string& camera,
                                                    const std::string& device,
                                                    const CameraOpening& opening,
                                                    const Cancelled& cancelled) {
    auto turn = lock(opening.aravis, cancelled);
    if (!turn.owns_lock()) return std::nullopt;
    const auto found = find_on_usb(device);
    if (!found) return std::nullopt;
    turn.unlock();
    if (auto free = check_claim(camera, device, found->id, opening.claims); !free)
        return Unexpected(free.error());
    const auto description = read_usb_description(device, found->name, cancelled);
    if (!description) return Unexpected(description.error());
    if (auto good = opening.descriptions.vet(device, *description, cancelled); !good)
        return problem(CameraState::failed, good.error());
    turn = lock(opening.aravis, cancelled);
    if (!turn.owns_lock()) return Unexpected(absent(device));
    auto opened = open_usb_device(device, *found);
    if (!opened) return Unexpected(opened.error());
    auto own = camera_of(device, std::move(*opened));
    if (!own) return Unexpected(own.error());
    return OpenCamera{std::move(*own), std::nullopt};
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
        case CameraState::stopped: return "stopped";
        case CameraState::failed: return "failed";
    }
    return "unknown";
}

std::unique_lock<std::timed_mutex> lock(std::timed_mutex& mutex, const Cancelled& cancelled) {
    std::unique_lock turn(mutex, std::defer_lock);
    while (!cancelled() && !turn.try_lock_for(std::chrono::nanoseconds(cancelled_interval.ns))) {
    }
    return turn;
}

CameraResult<OpenCamera> open_camera(const std::string& camera, const std::string& device,
                                     const CameraOpening& opening, const Cancelled& cancelled) {
    const bool by_address = parse_address(device).has_value();
    DeviceSearch search(device);
    auto found = search.wait(by_address ? address_patience : first_broadcast_patience, cancelled);
    if (!found && !by_address) {
        if (auto on_usb = open_on_usb(camera, device, opening, cancelled))
            return std::move(*on_usb);
        found = search.wait(broadcast_patience, cancelled);
    }
    if (!found) return Unexpected(absent(device));
    return open_on_network(camera, device, *found, opening, cancelled);
}

}  // namespace versavis::daemon
