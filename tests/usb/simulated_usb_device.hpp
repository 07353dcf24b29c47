// SPDX-License-Identifier: BSD-3-Clause
// A USB CDC-ACM device (full speed, 1209:5653) that exists only inside a umockdev testbed. A
// program started under umockdev-wrapper finds it with an unmodified libusb, as if it were plugged
// in.
#pragma once

#include <umockdev.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "simulated_device.hpp"

namespace versavis::test {

class CdcAcmFunction;

/// plug(), unplug() and the destructor belong to one thread; send() and line_state_set() may be
/// called from any.
class SimulatedUsbDevice {
 public:
    /// Bytes the host wrote to the bulk OUT endpoint; called on the testbed's
    /// GLib thread, so it must not block. It may call send(). With a client
    /// already running it can be called before the constructor has returned.
    using OnReceive = std::function<void(std::span<const std::byte>)>;

    /// `port` as in sysfs. `on_touch`: the host closed the port at 1200 baud; the same holds.
    SimulatedUsbDevice(UMockdevTestbed* testbed, std::string serial, OnReceive on_receive,
                       const std::string& port = "1-1", std::function<void()> on_touch = {});
    ~SimulatedUsbDevice();
    SimulatedUsbDevice(const SimulatedUsbDevice&) = delete;
    SimulatedUsbDevice& operator=(const SimulatedUsbDevice&) = delete;

    /// Queues bytes for the bulk IN endpoint.
    void send(std::span<const std::byte> bytes);
    /// Bytes not yet fetched by the host are lost.
    void unplug() { device_.unplug(); }
    void plug() { device_.plug(); }
    /// See UsbfsNode.
    void hang() { device_.node().hang(); }
    bool hangs() { return device_.node().hangs(); }
    /// True once the host has raised DTR with SET_CONTROL_LINE_STATE.
    bool line_state_set() const;

 private:
    std::shared_ptr<CdcAcmFunction> function_;
    SimulatedDevice device_;
};

}  // namespace versavis::test
