// SPDX-License-Identifier: BSD-3-Clause
#include "device/usb_bus.hpp"

#include <fmt/format.h>
#include <libusb.h>

#include <algorithm>
#include <array>

namespace versavis::device {

namespace {

Unexpected<UsbError> usb_failure(int code) { return Unexpected<UsbError>(usb_error(code)); }

/// libusb takes 0 for ever.
unsigned milliseconds_of(Duration timeout) {
    return static_cast<unsigned>(std::max<std::int64_t>(1, timeout.ns / 1'000'000));
}

std::string port_of(libusb_device* device) {
    std::array<std::uint8_t, 7> ports{};
    const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
    std::string name = fmt::format("usb:{}", libusb_get_bus_number(device));
    for (int i = 0; i < depth; ++i)
        name += fmt::format("{}{}", i == 0 ? '-' : '.', ports[static_cast<std::size_t>(i)]);
    return name;
}

bool fits(const libusb_interface_descriptor& setting, const UsbClass& wanted) {
    return setting.bInterfaceClass == wanted.code &&
           setting.bInterfaceSubClass == wanted.subclass.value_or(setting.bInterfaceSubClass) &&
           setting.bInterfaceProtocol == wanted.protocol.value_or(setting.bInterfaceProtocol);
}

libusb_device_descriptor descriptor_of(libusb_device* device) {
    libusb_device_descriptor descriptor{};
    libusb_get_device_descriptor(device, &descriptor);
    return descriptor;
}

/// Empty: the device has none. None: it has one and does not say it.
std::optional<std::string> text_of(libusb_device_handle* handle,
                                   std::uint8_t libusb_device_descriptor::*index) {
    const std::uint8_t at = descriptor_of(libusb_get_device(handle)).*index;
    std::array<unsigned char, 256> text{};
    const int size =
        libusb_get_string_descriptor_ascii(handle, at, text.data(), static_cast<int>(text.size()));
    if (size > 0)
        return std::string(reinterpret_cast<const char*>(text.data()),
                           static_cast<std::size_t>(size));
    return at == 0 ? std::optional(std::string()) : std::nullopt;
}

}  // namespace

UsbError usb_error(int code) {
    switch (code) {
        case LIBUSB_ERROR_NO_DEVICE:
        case LIBUSB_ERROR_NOT_FOUND:
        case LIBUSB_ERROR_IO: return {UsbFault::gone, code};
        case LIBUSB_ERROR_PIPE: return {UsbFault::stalled, code};
        case LIBUSB_ERROR_TIMEOUT: return {UsbFault::late, code};
        case LIBUSB_ERROR_BUSY: return {UsbFault::busy, code};
        case LIBUSB_ERROR_ACCESS: return {UsbFault::denied, code};
        default: return {UsbFault::other, code};
    }
}

const char* UsbError::name() const { return libusb_error_name(code); }

Error UsbError::as_error(const std::string& where, const std::string& what) const {
    switch (fault) {
        case UsbFault::gone:
            return {where, what + ": the board was unplugged or reset",
                    "check its cable and power"};
        case UsbFault::stalled: return {where, what + ": the board refuses", ""};
        case UsbFault::late: return {where, what + ": the board does not answer", "reconnect it"};
        case UsbFault::busy:
            return {where, what + ": another program has the board open", "close it"};
        case UsbFault::denied:
            return {where, what + ": this user may not open it",
                    "install the udev rule and join the group 'versavis', or use sudo"};
        case UsbFault::foreign:
            return {where, what + ": it is no board of this project, or has other firmware",
                    "put firmware into it: hold BOOTSEL while you plug it in, then versavis flash"};
        case UsbFault::other: break;
    }
    return {where, fmt::format("{}: {}", what, name()), "reconnect it"};
}

std::optional<std::string> UsbHandle::serial() const {
    return text_of(handle_.get(), &libusb_device_descriptor::iSerialNumber);
}

std::string UsbHandle::manufacturer() const {
    return text_of(handle_.get(), &libusb_device_descriptor::iManufacturer).value_or("");
}

std::string UsbHandle::product() const {
    return text_of(handle_.get(), &libusb_device_descriptor::iProduct).value_or("");
}

void UsbHandle::reset() { libusb_reset_device(handle_.get()); }

// The last first: a driver of several interfaces looks for all of them when it gets its first one.
UsbHandle::~UsbHandle() {
    for (auto interface = claimed_.rbegin(); interface != claimed_.rend(); ++interface)
        libusb_release_interface(handle_.get(), *interface);
}

UsbExpected<> UsbHandle::claim(int interface) {
    libusb_set_auto_detach_kernel_driver(handle_.get(), 1);
    const int code = libusb_claim_interface(handle_.get(), interface);
    if (code != 0) return usb_failure(code);
    claimed_.push_back(interface);
    return {};
}

UsbExpected<std::size_t> UsbHandle::read(std::uint8_t endpoint, std::span<std::uint8_t> into,
                                         Duration timeout) {
    int size = 0;
    const int code =
        libusb_bulk_transfer(handle_.get(), endpoint, into.data(), static_cast<int>(into.size()),
                             &size, milliseconds_of(timeout));
    if (code != 0 && !(code == LIBUSB_ERROR_TIMEOUT && size > 0)) return usb_failure(code);
    return static_cast<std::size_t>(size);
}

UsbExpected<> UsbHandle::write(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                               Duration timeout) {
    int size = 0;
    // libusb takes one pointer for both directions, and does not write through this one.
    auto* data = const_cast<std::uint8_t*>(bytes.data());
    const int code =
        libusb_bulk_transfer(handle_.get(), endpoint, data, static_cast<int>(bytes.size()), &size,
                             milliseconds_of(timeout));
    if (code != 0) return usb_failure(code);
    if (static_cast<std::size_t>(size) != bytes.size()) return usb_failure(LIBUSB_ERROR_TIMEOUT);
    return {};
}

UsbExpected<> UsbHandle::clear_halt(std::uint8_t endpoint) {
    const int code = libusb_clear_halt(handle_.get(), endpoint);
    if (code != 0) return usb_failure(code);
    return {};
}

UsbExpected<std::size_t> UsbHandle::control(std::uint8_t type, std::uint8_t request,
                                            std::uint16_t value, int interface,
                                            std::span<std::uint8_t> data, Duration timeout) {
    const int size = libusb_control_transfer(
        handle_.get(), type, request, value, static_cast<std::uint16_t>(interface), data.data(),
        static_cast<std::uint16_t>(data.size()), milliseconds_of(timeout));
    if (size < 0) return usb_failure(size);
    return static_cast<std::size_t>(size);
}

UsbDevice::UsbDevice(std::shared_ptr<libusb_context> context, libusb_device* device)
    : context_(std::move(context)),
      // The context must outlive its devices.
      device_(libusb_ref_device(device),
              [kept = context_](libusb_device* old) { libusb_unref_device(old); }),
      port_(port_of(device)) {}

bool UsbDevice::is(std::uint16_t vendor, std::uint16_t product) const {
    const libusb_device_descriptor found = descriptor_of(device_.get());
    return found.idVendor == vendor && found.idProduct == product;
}

UsbFunction UsbDevice::function(const UsbClass& wanted) const {
    UsbFunction function;
    libusb_config_descriptor* configuration = nullptr;
    if (libusb_get_active_config_descriptor(device_.get(), &configuration) != 0) return function;
    for (int i = 0; i < configuration->bNumInterfaces && function.interface < 0; ++i) {
        const libusb_interface_descriptor& setting = configuration->interface[i].altsetting[0];
        if (!fits(setting, wanted)) continue;
        function.interface = setting.bInterfaceNumber;
        for (int e = 0; e < setting.bNumEndpoints; ++e) {
            const std::uint8_t address = setting.endpoint[e].bEndpointAddress;
            ((address & LIBUSB_ENDPOINT_IN) != 0 ? function.endpoint_in : function.endpoint_out) =
                address;
        }
    }
    libusb_free_config_descriptor(configuration);
    return function;
}

UsbExpected<UsbHandle> UsbDevice::open() const {
    libusb_device_handle* handle = nullptr;
    if (const int code = libusb_open(device_.get(), &handle); code != 0) return usb_failure(code);
    return UsbHandle(*this, {handle, libusb_close});
}

Expected<UsbBus> UsbBus::open() {
    libusb_context* context = nullptr;
    if (const int code = libusb_init(&context); code != 0)
        return failure("USB", fmt::format("libusb cannot start: {}", libusb_error_name(code)),
                       "is /dev/bus/usb there?");
    return UsbBus(
        std::shared_ptr<libusb_context>(context, [](libusb_context* old) { libusb_exit(old); }));
}

std::vector<UsbDevice> UsbBus::devices() const {
    std::vector<UsbDevice> found;
    libusb_device** devices = nullptr;
    const ssize_t count = libusb_get_device_list(context_.get(), &devices);
    for (ssize_t i = 0; i < count; ++i) found.emplace_back(context_, devices[i]);
    if (count >= 0) libusb_free_device_list(devices, 1);
    return found;
}

std::vector<UsbDevice> UsbBus::find(std::uint16_t vendor, std::uint16_t product) const {
    std::vector<UsbDevice> found = devices();
    std::erase_if(found, [&](const UsbDevice& device) { return !device.is(vendor, product); });
    return found;
}

}  // namespace versavis::device
