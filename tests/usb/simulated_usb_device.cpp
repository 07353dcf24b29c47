// SPDX-License-Identifier: BSD-3-Clause
#include "simulated_usb_device.hpp"

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

namespace versavis::test {

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr const char* sysfs_path = "/sys/devices/usb1/1-1";
constexpr const char* manufacturer = "Simulated";
constexpr const char* product = "Simulated CDC-ACM device";

// clang-format off
constexpr std::array<std::uint8_t, 18> device_descriptor{
    18, 1, 0x00, 0x02,  // USB 2.0
    0xef, 2, 1,         // class by interface association
    64, 0x09, 0x12, 0x53, 0x56, 0x00, 0x01,
    1, 2, 3,            // manufacturer, product, serial
    1};
constexpr std::array<std::uint8_t, 75> configuration_descriptor{
    9, 2, 75, 0, UsbFunction::interface_count, 1, 0, 0x80, 50,
    8, 11, 0, 2, 2, 2, 0, 0,            // association: interfaces 0 and 1 are one ACM
    9, 4, 0, 0, 1, 2, 2, 0, 0,          // interface 0: communication, ACM
    5, 0x24, 0x00, 0x20, 0x01,          // CDC 1.2
    5, 0x24, 0x01, 0x00, 1,             // call management: none
    4, 0x24, 0x02, 0x02,                // line coding and line state
    5, 0x24, 0x06, 0, 1,                // union of 0 and 1
    7, 5, UsbFunction::interrupt_in_endpoint, 3, 8, 0, 16,
    9, 4, 1, 0, 2, 10, 0, 0, 0,         // interface 1: data
    7, 5, UsbFunction::bulk_out_endpoint, 2, 64, 0, 0,
    7, 5, UsbFunction::bulk_in_endpoint, 2, 64, 0, 0};
// clang-format on

std::uint16_t little_endian_16(std::span<const std::uint8_t> bytes, std::size_t offset) {
    return static_cast<std::uint16_t>(bytes[offset] | bytes[offset + 1] << 8);
}

Bytes string_descriptor(std::string_view ascii) {
    Bytes result{static_cast<std::uint8_t>(2 + 2 * ascii.size()), 3};
    for (char c : ascii) result.insert(result.end(), {static_cast<std::uint8_t>(c), 0});
    return result;
}

void append_hex(std::string& text, std::span<const std::uint8_t> bytes) {
    for (std::uint8_t byte : bytes) {
        std::array<char, 3> digits{};
        std::snprintf(digits.data(), digits.size(), "%02X", static_cast<unsigned>(byte));
        text += digits.data();
    }
}

}  // namespace

// The CDC-ACM device behind the node.
class CdcAcmFunction final : public UsbFunction {
 public:
    CdcAcmFunction(std::string serial, SimulatedUsbDevice::OnReceive on_receive)
        : serial_{std::move(serial)}, on_receive_{std::move(on_receive)} {}

    int control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> out,
                Bytes& reply) override;
    void receive(std::span<const std::byte> bytes) override {
        const std::lock_guard lock{receive_mutex_};
        if (on_receive_) on_receive_(bytes);
    }
    // No callback runs once this has returned.
    void silence() {
        const std::lock_guard lock{receive_mutex_};
        on_receive_ = nullptr;
    }
    void reset_line_state() { line_state_set_ = false; }
    bool line_state_set() const { return line_state_set_; }

 private:
    int descriptor(std::uint16_t value, Bytes& reply) const;

    const std::string serial_;
    Bytes line_coding_{0x00, 0xc2, 0x01, 0x00, 0, 0, 8};  // 115200 8N1
    std::atomic<bool> line_state_set_ = false;
    std::mutex receive_mutex_;
    SimulatedUsbDevice::OnReceive on_receive_;
};

int CdcAcmFunction::control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> out,
                            Bytes& reply) {
    const std::uint16_t value = little_endian_16(setup, 2);
    switch (setup[0] << 8 | setup[1]) {
        case 0x8006:  // GET_DESCRIPTOR
            return descriptor(value, reply);
        case 0x2120:  // SET_LINE_CODING
            if (out.size() != line_coding_.size()) return -EPIPE;
            line_coding_.assign(out.begin(), out.end());
            return 0;
        case 0xa121:  // GET_LINE_CODING
            reply = line_coding_;
            return 0;
        case 0x2122:  // SET_CONTROL_LINE_STATE; bit 0 is DTR
            line_state_set_ = (value & 1) != 0;
            return 0;
        default: return -EPIPE;
    }
}

int CdcAcmFunction::descriptor(std::uint16_t value, Bytes& reply) const {
    switch (value) {
        case 0x0100: reply.assign(device_descriptor.begin(), device_descriptor.end()); return 0;
        case 0x0200: reply.assign(configuration_descriptor.begin(), configuration_descriptor.end()); return 0;
        case 0x0300:
            reply = {4, 3, 0x09, 0x04};  // US English
            return 0;
        case 0x0301: reply = string_descriptor(manufacturer); return 0;
        case 0x0302: reply = string_descriptor(product); return 0;
        case 0x0303: reply = string_descriptor(serial_); return 0;
        default: return -EPIPE;
    }
}

namespace {

using NodePtr = std::shared_ptr<UsbfsNode>;

void connect_signal(UMockdevIoctlBase* handler, const char* name, GCallback callback, const NodePtr& node) {
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

std::string attribute(const std::string& name, const std::string& value) {
    return "\nA: " + name + "=" + value + "\\n";  // the testbed unescapes it
}

// The testbed's description of the device. Loading it creates sysfs entries and
// the node first and sends the "add" uevent last, so a client sees no half device.
std::string describe(const std::string& serial, unsigned device_number) {
    std::array<char, 4> number{};
    std::snprintf(number.data(), number.size(), "%03u", device_number);
    const std::string node = std::string{"bus/usb/001/"} + number.data();
    const std::string decimal = std::to_string(device_number);
    const std::string minor = std::to_string(device_number - 1);
    std::string text = "P: " + std::string{sysfs_path}.substr(std::strlen("/sys")) + "\nN: " + node;
    text += "\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: DEVNAME=/dev/" + node;
    text += "\nE: MAJOR=189\nE: MINOR=" + minor + "\nE: BUSNUM=001\nE: DEVNUM=" + number.data();
    // Like the kernel's, attributes end with a newline; not "dev", which umockdev
    // uses verbatim as a file name.
    text += "\nA: dev=189:" + minor;
    text += attribute("busnum", "1") + attribute("devnum", decimal) + attribute("speed", "12");
    text += attribute("idVendor", "1209") + attribute("idProduct", "5653");
    text += attribute("bConfigurationValue", "1") + attribute("manufacturer", manufacturer);
    text += attribute("product", product) + attribute("serial", serial);
    text += "\nH: descriptors=";
    append_hex(text, device_descriptor);
    append_hex(text, configuration_descriptor);
    return text + "\n";
}

}  // namespace

SimulatedUsbDevice::SimulatedUsbDevice(UMockdevTestbed* testbed, std::string serial, OnReceive on_receive,
                                       std::chrono::milliseconds idle_hold)
    : testbed_{static_cast<UMockdevTestbed*>(g_object_ref(testbed))},
      handler_{umockdev_ioctl_base_new()},
      function_{std::make_shared<CdcAcmFunction>(serial, std::move(on_receive))},
      node_{std::make_shared<UsbfsNode>(function_, idle_hold)},
      serial_{std::move(serial)} {
    connect_signal(handler_.get(), "handle-ioctl", G_CALLBACK(handle_ioctl), node_);
    connect_signal(handler_.get(), "client-connected", G_CALLBACK(client_connected), node_);
    plug();
}

SimulatedUsbDevice::~SimulatedUsbDevice() {
    unplug();
    function_->silence();
}

void SimulatedUsbDevice::plug() {
    if (!device_path_.empty()) return;
    device_number_ = device_number_ < 127 ? device_number_ + 1 : 2;
    const std::string text = describe(serial_, device_number_);
    const std::size_t begin = text.find("bus/usb/");
    device_path_ = "/dev/" + text.substr(begin, text.find('\n', begin) - begin);
    node_->attach(device_path_);
    // Listen before the uevent: a client may open the node as soon as it hears of it.
    umockdev_testbed_attach_ioctl(testbed_.get(), device_path_.c_str(), handler_.get(), nullptr);
    GError* error = nullptr;
    if (!umockdev_testbed_add_from_string(testbed_.get(), text.c_str(), &error)) {
        const std::string message = error->message;
        g_error_free(error);
        throw std::runtime_error{"cannot add the simulated device: " + message};
    }
}

void SimulatedUsbDevice::unplug() {
    if (device_path_.empty()) return;
    node_->detach();
    function_->reset_line_state();
    // The uevent is built from sysfs, so it comes before the removal.
    umockdev_testbed_uevent(testbed_.get(), sysfs_path, "remove");
    umockdev_testbed_remove_device(testbed_.get(), sysfs_path);
    umockdev_testbed_detach_ioctl(testbed_.get(), device_path_.c_str(), nullptr);
    device_path_.clear();
}

void SimulatedUsbDevice::send(std::span<const std::byte> bytes) { node_->send(bytes); }

bool SimulatedUsbDevice::line_state_set() const { return function_->line_state_set(); }

}  // namespace versavis::test
