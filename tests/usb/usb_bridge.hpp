// SPDX-License-Identifier: BSD-3-Clause
// Puts the rig's board on simulated USB: passes bytes between its unix socket and the bulk
// endpoints.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "simulated_usb_device.hpp"

namespace versavis::test {

class UsbBridge {
 public:
    /// Throws when the rig's socket cannot be reached.
    UsbBridge(UMockdevTestbed* testbed, const std::string& socket_path, const std::string& serial);
    ~UsbBridge();
    UsbBridge(const UsbBridge&) = delete;
    UsbBridge& operator=(const UsbBridge&) = delete;

    void unplug() { device_->unplug(); }
    void plug() { device_->plug(); }
    void hang() { device_->hang(); }
    bool hangs() { return device_->hangs(); }
    bool line_state_set() const { return device_->line_state_set(); }

 private:
    void forward();

    int socket_;
    std::unique_ptr<SimulatedUsbDevice> device_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace versavis::test
