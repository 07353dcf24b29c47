// SPDX-License-Identifier: BSD-3-Clause
#include "simulated_device.hpp"

#include <array>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace versavis::test {

namespace {

using NodePtr = std::shared_ptr<UsbfsNode>;

void connect_signal(UMockdevIoctlBase* handler, const char* name, GCallback callback,
                    const NodePtr& node) {
    // The handler outlives the device while a client has it open, so it shares the node.
    g_signal_connect_data(
        handler, name, callback, new NodePtr{node},
        [](gpointer data, GClosure*) { delete static_cast<NodePtr*>(data); }, GConnectFlags{});
}

gboolean handle_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer node) {
    (*static_cast<NodePtr*>(node))->on_ioctl(client);
    return TRUE;
}

void client_connected(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer node) {
    (*static_cast<NodePtr*>(node))->on_connected(client);
}

// Numbers belong to the bus, which all devices of the process share.
unsigned next_device_number() {
    static std::atomic<unsigned> count{0};
    return 2 + count++ % 126;
}

std::string formatted(const char* format, unsigned value) {
    std::array<char, 16> text{};
    std::snprintf(text.data(), text.size(), format, value);
    return text.data();
}

std::string attribute(const std::string& name, const std::string& value) {
    return "\nA: " + name + "=" + value + "\\n";  // the testbed unescapes it
}

std::string word_at(const Bytes& bytes, std::size_t at) {
    return formatted("%04x", bytes[at] | static_cast<unsigned>(bytes[at + 1]) << 8U);
}

}  // namespace

SimulatedDevice::SimulatedDevice(UMockdevTestbed* testbed, const std::string& port,
                                 std::shared_ptr<UsbFunction> function,
                                 std::chrono::milliseconds idle_hold)
    : testbed_{static_cast<UMockdevTestbed*>(g_object_ref(testbed))},
      handler_{umockdev_ioctl_base_new()},
      function_{std::move(function)},
      node_{std::make_shared<UsbfsNode>(function_, idle_hold)},
      sysfs_path_{"/sys/devices/usb1/" + port} {
    connect_signal(handler_.get(), "handle-ioctl", G_CALLBACK(handle_ioctl), node_);
    connect_signal(handler_.get(), "client-connected", G_CALLBACK(client_connected), node_);
    plug();
}

SimulatedDevice::~SimulatedDevice() { unplug(); }

// Loading the description creates sysfs entries and the node first and sends the "add" uevent last,
// so that no client sees half a device.
std::string SimulatedDevice::describe(const std::string& node, unsigned device_number) const {
    const UsbDescription& usb = function_->description();
    const std::string minor = std::to_string(device_number - 1);
    std::string text = "P: " + sysfs_path_.substr(std::strlen("/sys")) + "\nN: " + node;
    text += "\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: DEVNAME=/dev/" + node;
    text += "\nE: MAJOR=189\nE: MINOR=" + minor +
            "\nE: BUSNUM=001\nE: DEVNUM=" + formatted("%03u", device_number);
    // Like the kernel's, attributes end with a newline; not "dev", which umockdev uses verbatim as
    // a file name.
    text += "\nA: dev=189:" + minor;
    text += attribute("busnum", "1") + attribute("devnum", std::to_string(device_number));
    text +=
        attribute("speed", std::to_string(usb.speed_mbit)) + attribute("bConfigurationValue", "1");
    text += attribute("idVendor", word_at(usb.device, 8)) +
            attribute("idProduct", word_at(usb.device, 10));
    const std::array<const char*, 3> names{"manufacturer", "product", "serial"};
    for (std::size_t i = 0; i < names.size(); ++i) {
        const unsigned index = usb.device[14 + i];
        if (index > 0) text += attribute(names[i], usb.strings.at(index - 1));
    }
    text += "\nH: descriptors=";
    for (const Bytes* part : {&usb.device, &usb.configuration})
        for (const std::uint8_t byte : *part) text += formatted("%02X", byte);
    return text + "\n";
}

void SimulatedDevice::plug() {
    if (!device_path_.empty()) return;
    const unsigned number = next_device_number();
    const std::string node = "bus/usb/001/" + formatted("%03u", number);
    device_path_ = "/dev/" + node;
    node_->attach(device_path_);
    // Listen before the uevent: a client may open the node as soon as it hears of it.
    umockdev_testbed_attach_ioctl(testbed_.get(), device_path_.c_str(), handler_.get(), nullptr);
    GError* error = nullptr;
    if (!umockdev_testbed_add_from_string(testbed_.get(), describe(node, number).c_str(), &error)) {
        const std::string message = error->message;
        g_error_free(error);
        throw std::runtime_error{"cannot add the simulated device: " + message};
    }
}

void SimulatedDevice::unplug() {
    if (device_path_.empty()) return;
    node_->detach();
    // The uevent is built from sysfs, so it comes before the removal.
    umockdev_testbed_uevent(testbed_.get(), sysfs_path_.c_str(), "remove");
    umockdev_testbed_remove_device(testbed_.get(), sysfs_path_.c_str());
    umockdev_testbed_detach_ioctl(testbed_.get(), device_path_.c_str(), nullptr);
    device_path_.clear();
}

}  // namespace versavis::test
