// SPDX-License-Identifier: BSD-3-Clause
// A USB CDC-ACM device (full speed, 1209:5653) that exists only inside a umockdev testbed. A program started
// under umockdev-wrapper finds it with an unmodified libusb, as if it were plugged in.
#pragma once

#include "usbfs_node.hpp"

#include <umockdev.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>

namespace versavis::test {

class CdcAcmFunction;

/// plug(), unplug() and the destructor belong to one thread; send() and
/// line_state_set() may be called from any. The testbed must outlive every
/// client process: a client whose simulator goes away is aborted by umockdev.
class SimulatedUsbDevice {
 public:
    /// Bytes the host wrote to the bulk OUT endpoint; called on the testbed's
    /// GLib thread, so it must not block. It may call send(). With a client
    /// already running it can be called before the constructor has returned.
    using OnReceive = std::function<void(std::span<const std::byte>)>;

    /// The fake node always polls as ready, so libusb asks again at once when
    /// nothing is done. A repeated question is answered only after idle_hold,
    /// which keeps client and simulator from spinning; 0 disables the hold.
    SimulatedUsbDevice(UMockdevTestbed* testbed, std::string serial, OnReceive on_receive,
                       std::chrono::milliseconds idle_hold = std::chrono::milliseconds{1});
    ~SimulatedUsbDevice();
    SimulatedUsbDevice(const SimulatedUsbDevice&) = delete;
    SimulatedUsbDevice& operator=(const SimulatedUsbDevice&) = delete;

    /// Queues bytes for the bulk IN endpoint.
    void send(std::span<const std::byte> bytes);

    /// Surprise removal: pending urbs end with -ESHUTDOWN, ioctls with ENODEV.
    /// Bytes not yet fetched by the host are lost.
    void unplug();

    /// Attaches again under the next device number, as a kernel would.
    void plug();

    /// True once the host has raised DTR with SET_CONTROL_LINE_STATE.
    bool line_state_set() const;

 private:
    GObjectPtr<UMockdevTestbed> testbed_;
    GObjectPtr<UMockdevIoctlBase> handler_;
    std::shared_ptr<CdcAcmFunction> function_;
    std::shared_ptr<UsbfsNode> node_;
    std::string serial_;
    std::string device_path_;  // /dev/bus/usb/…; empty while unplugged
    unsigned device_number_ = 1;
};

}  // namespace versavis::test
