// SPDX-License-Identifier: BSD-3-Clause
// The USB devices that service and tool talk to, through libusb.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "versavis/error.hpp"
#include "versavis/time.hpp"

struct libusb_context;
struct libusb_device;
struct libusb_device_handle;

namespace versavis::device {

/// Why something on USB was not done.
enum class UsbFault {
    gone,     ///< the device is not there any more
    stalled,  ///< it refuses
    late,     ///< it did not answer in time
    busy,     ///< another program has it
    denied,   ///< this user may not
    foreign,  ///< it lacks the function that is looked for
    other,
};

struct UsbError {
    UsbFault fault = UsbFault::other;
    int code = 0;  ///< of libusb

    const char* name() const;  ///< of the code
    /// As an error of the device named `where`.
    Error as_error(const std::string& where, const std::string& what) const;
};

/// The error that a code of libusb stands for.
UsbError usb_error(int code);

template <class T = void>
using UsbExpected = Expected<T, UsbError>;

/// What a function is for; no subclass or protocol: whatever it has.
struct UsbClass {
    std::uint8_t code = 0;
    std::optional<std::uint8_t> subclass{};
    std::optional<std::uint8_t> protocol{};
};

/// Where the function of a class lies within a device.
struct UsbFunction {
    int interface = -1;
    std::uint8_t endpoint_in = 0;
    std::uint8_t endpoint_out = 0;

    bool complete() const { return interface >= 0 && endpoint_in != 0 && endpoint_out != 0; }
};

class UsbHandle;

/// A device on the bus. It need not be there any more.
class UsbDevice {
 public:
    UsbDevice(std::shared_ptr<libusb_context> context, libusb_device* device);

    bool is(std::uint16_t vendor, std::uint16_t product) const;
    UsbExpected<UsbHandle> open() const;
    /// Its first interface of this class.
    UsbFunction function(const UsbClass& wanted) const;
    /// Bus, then the ports of the hubs on the way, as the kernel names it.
    const std::string& port() const { return port_; }

 private:
    std::shared_ptr<libusb_context> context_;
    std::shared_ptr<libusb_device> device_;
    std::string port_;
};

/// A device that is open. Interfaces that were claimed are given back with it, and the kernel's
/// driver has them again.
class UsbHandle {
 public:
    UsbHandle(UsbDevice device, std::shared_ptr<libusb_device_handle> handle)
        : device_(std::move(device)), handle_(std::move(handle)) {}
    UsbHandle(UsbHandle&&) noexcept = default;
    UsbHandle& operator=(UsbHandle&&) = delete;
    ~UsbHandle();

    const UsbDevice& device() const { return device_; }
    /// Empty: it has none. None: it has one and does not say it, as a device that hangs.
    std::optional<std::string> serial() const;
    std::string manufacturer() const;
    std::string product() const;
    /// Of the bus. It may be another device after that, which has to be found anew.
    void reset();

    /// Takes the interface from the kernel, too, if that has a driver for it.
    UsbExpected<> claim(int interface);

    /// How many bytes came, at most as many as `into` has room for. Those that came before a
    /// time-out are no failure.
    UsbExpected<std::size_t> read(std::uint8_t endpoint, std::span<std::uint8_t> into,
                                  Duration timeout);
    UsbExpected<> write(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                        Duration timeout);
    /// Both sides begin anew with it.
    UsbExpected<> clear_halt(std::uint8_t endpoint);
    /// A request to an interface, in or out by its type.
    UsbExpected<std::size_t> control(std::uint8_t type, std::uint8_t request, std::uint16_t value,
                                     int interface, std::span<std::uint8_t> data, Duration timeout);

    libusb_device_handle* get() const { return handle_.get(); }

 private:
    UsbDevice device_;
    std::shared_ptr<libusb_device_handle> handle_;
    std::vector<int> claimed_;
};

class UsbBus {
 public:
    static Expected<UsbBus> open();

    std::vector<UsbDevice> devices() const;
    /// Those of this vendor and product.
    std::vector<UsbDevice> find(std::uint16_t vendor, std::uint16_t product) const;

    libusb_context* get() const { return context_.get(); }

 private:
    explicit UsbBus(std::shared_ptr<libusb_context> context) : context_(std::move(context)) {}

    std::shared_ptr<libusb_context> context_;
};

}  // namespace versavis::device
