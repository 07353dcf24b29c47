// SPDX-License-Identifier: BSD-3-Clause
// Any USB device that exists only inside a umockdev testbed: its place in sysfs, its node, plug and
// unplug.
#pragma once

#include <umockdev.h>

#include <chrono>
#include <memory>
#include <string>

#include "usbfs_node.hpp"

namespace versavis::test {

/// plug(), unplug() and the destructor belong to one thread. The testbed must outlive every client
/// process: a client whose simulator goes away is aborted by umockdev.
class SimulatedDevice {
 public:
    /// `port` as in sysfs, such as "1-2"; each device of a testbed has its own. It is plugged in at
    /// once. `idle_hold`: the fake node always polls as ready, so a repeated question of libusb is
    /// answered only after this time; 0 disables the hold.
    SimulatedDevice(UMockdevTestbed* testbed, const std::string& port,
                    std::shared_ptr<UsbFunction> function,
                    std::chrono::milliseconds idle_hold = std::chrono::milliseconds{1});
    ~SimulatedDevice();
    SimulatedDevice(const SimulatedDevice&) = delete;
    SimulatedDevice& operator=(const SimulatedDevice&) = delete;

    /// Surprise removal: pending urbs end with -ESHUTDOWN, ioctls with ENODEV.
    void unplug();
    /// Attaches again under the next device number, as a kernel would.
    void plug();
    UsbfsNode& node() { return *node_; }

 private:
    std::string describe(const std::string& node, unsigned device_number) const;

    GObjectPtr<UMockdevTestbed> testbed_;
    GObjectPtr<UMockdevIoctlBase> handler_;
    std::shared_ptr<UsbFunction> function_;
    std::shared_ptr<UsbfsNode> node_;
    std::string sysfs_path_;
    std::string device_path_;  // /dev/bus/usb/...; empty while unplugged
};

}  // namespace versavis::test
