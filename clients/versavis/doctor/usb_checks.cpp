// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/usb_checks.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>

namespace versavis::client {

namespace {

constexpr const char* devices_folder = "/sys/bus/usb/devices/";
constexpr const char* usbfs_memory = "/sys/module/usbcore/parameters/usbfs_memory_mb";

/// For the transfers that are pending for one camera; the kernel's default is 16.
constexpr std::int64_t memory_of_camera_mb = 128;

/// SuperSpeed, Mbit/s.
constexpr std::int64_t camera_speed = 5000;

constexpr std::array rule_folders{"/etc/udev/rules.d/", "/run/udev/rules.d/",
                                  "/usr/local/lib/udev/rules.d/", "/lib/udev/rules.d/",
                                  "/usr/lib/udev/rules.d/"};
constexpr const char* rule_file = "60-versavis.rules";

enum class Kind { board, boot_loader, camera };

struct UsbNode {
    std::string name;  ///< as the kernel's: bus, then ports
    Kind kind;

    std::string label() const {
        switch (kind) {
            case Kind::board: return "board";
            case Kind::boot_loader: return "boot loader";
            case Kind::camera: break;
        }
        return "camera " + name;
    }
};

std::string folder(const UsbNode& node) { return devices_folder + node.name; }

/// An interface of USB3 Vision is class 239, subclass 5.
bool is_camera(const HostFiles& files, const std::string& device) {
    const std::string path = devices_folder + device;
    for (const std::string& entry : files.list(path)) {
        if (entry.rfind(device + ":", 0) != 0) continue;
        const std::string interface = fmt::format("{}/{}", path, entry);
        if (files.text(interface + "/bInterfaceClass") == "ef" &&
            files.text(interface + "/bInterfaceSubClass") == "05")
            return true;
    }
    return false;
}

std::vector<UsbNode> find_devices(const HostFiles& files) {
    std::vector<UsbNode> found;
    for (const std::string& name : files.list(devices_folder)) {
        const std::string path = devices_folder + name;
        const std::string id = files.text(path + "/idVendor").value_or("") + ":" +
                               files.text(path + "/idProduct").value_or("");
        if (id == "1209:5653")
            found.push_back({name, Kind::board});
        else if (id == "2e8a:0003")
            found.push_back({name, Kind::boot_loader});
        else if (is_camera(files, name))
            found.push_back({name, Kind::camera});
    }
    return found;
}

/// The group that the udev rule names, or everybody, may use it.
bool open_to_group(const struct stat& node, const std::string& wanted) {
    if ((node.st_mode & S_IROTH) != 0 && (node.st_mode & S_IWOTH) != 0) return true;
    const group* owner = ::getgrnam(wanted.c_str());
    return owner != nullptr && owner->gr_gid == node.st_gid && (node.st_mode & S_IRGRP) != 0 &&
           (node.st_mode & S_IWGRP) != 0;
}

Findings check_permission(const HostFiles& files, const UsbNode& usb) {
    const auto bus = files.number(folder(usb) + "/busnum");
    const auto number = files.number(folder(usb) + "/devnum");
    if (!bus || !number) return {};
    const std::string path = fmt::format("/dev/bus/usb/{:03}/{:03}", *bus, *number);
    struct stat node {};
    if (::stat(files.path(path).c_str(), &node) != 0) return {};
    const group* owner = ::getgrgid(node.st_gid);
    Finding finding{"usb_permission", usb.label(),
                    fmt::format("{} is {:o}, group {}", path, node.st_mode & 07777U,
                                owner != nullptr ? owner->gr_name : "?")};
    const bool flashed = usb.kind == Kind::boot_loader;
    if (open_to_group(node, flashed ? "versavis-admin" : "versavis")) return {finding};
    finding.verdict = Verdict::bad;
    finding.reason = "it is closed to its group: the udev rule was not applied";
    finding.cure =
        "sudo udevadm control --reload && sudo udevadm trigger --subsystem-match=usb --action=add";
    return {finding};
}

Findings check_power(const HostFiles& files, const UsbNode& usb) {
    const std::string path = folder(usb) + "/power/control";
    const auto control = files.text(path);
    if (!control) return {};
    const std::int64_t delay =
        files.number(folder(usb) + "/power/autosuspend_delay_ms").value_or(-1);
    Finding finding{"autosuspend", usb.label(),
                    *control == "auto" ? fmt::format("on, after {} ms", delay) : "off"};
    if (*control != "auto" || delay < 0) return {finding};
    finding.verdict = Verdict::warning;
    finding.reason = "the kernel may suspend it; some devices do not wake up properly";
    finding.cure = fmt::format("echo on | sudo tee {}", path);
    finding.fix = Fix{path, "on"};
    return {finding};
}

Findings check_speed(const HostFiles& files, const UsbNode& usb) {
    const auto speed = files.number(folder(usb) + "/speed");
    if (usb.kind != Kind::camera || !speed) return {};
    Finding finding{"usb_speed", usb.label(), fmt::format("{} Mbit/s", *speed)};
    if (*speed < camera_speed) {
        finding.verdict = Verdict::bad;
        finding.reason = "it is not connected as USB 3: its frames do not fit";
        finding.cure = "another cable, or a port of the computer itself; then: lsusb -t";
    }
    return {finding};
}

Findings check_memory(const HostFiles& files, std::int64_t cameras) {
    const auto limit = files.number(usbfs_memory);
    if (cameras == 0 || !limit) return {};
    Finding finding{"usbfs_memory_mb", "", fmt::format("{} MB", *limit)};
    const std::int64_t needed = cameras * memory_of_camera_mb;
    if (*limit == 0 || *limit >= needed) return {finding};  // 0: no limit
    finding.verdict = Verdict::bad;
    finding.reason =
        fmt::format("transfers of {} USB3 Vision camera(s) need up to {} MB", cameras, needed);
    finding.cure = fmt::format(
        "echo {} | sudo tee {}; for good: usbcore.usbfs_memory_mb={} on the kernel's command line",
        needed, usbfs_memory, needed);
    finding.fix = Fix{usbfs_memory, std::to_string(needed)};
    return {finding};
}

Findings check_rule(const HostFiles& files) {
    for (const char* place : rule_folders) {
        const std::string path = std::string(place) + rule_file;
        if (!files.exists(path)) continue;
        Finding finding{"udev_rule", "", path};
        // A file of this name in /etc takes the place of the others, one without rules as well.
        if (!files.text(path).value_or("").empty()) return {finding};
        finding.verdict = Verdict::bad;
        finding.reason = "it is empty, and takes the place of the installed rule";
        finding.cure = fmt::format("sudo rm {} && sudo udevadm control --reload", path);
        return {finding};
    }
    Finding finding{"udev_rule", "", "not installed", Verdict::bad};
    finding.reason =
        fmt::format("no folder of udev has {}: the service may not open the board", rule_file);
    finding.cure = "install VersaVIS again: package or cmake --install";
    return {finding};
}

}  // namespace

Findings check_usb(const Subject& subject) {
    const HostFiles& files = subject.files;
    const std::vector<UsbNode> devices = find_devices(files);
    Findings findings;
    const auto add = [&findings](Findings more) {
        findings.insert(findings.end(), more.begin(), more.end());
    };
    if ((subject.uses_board() && subject.board_on_usb()) || !devices.empty())
        add(check_rule(files));
    for (const UsbNode& device : devices) {
        add(check_permission(files, device));
        add(check_power(files, device));
        add(check_speed(files, device));
    }
    add(check_memory(files, std::count_if(devices.begin(), devices.end(), [](const UsbNode& usb) {
                         return usb.kind == Kind::camera;
                     })));
    return findings;
}

}  // namespace versavis::client
