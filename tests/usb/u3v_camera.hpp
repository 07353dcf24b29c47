// SPDX-License-Identifier: BSD-3-Clause
// USB3 Vision as a transport of the rig's camera: control channel and stream on simulated USB.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <span>
#include <thread>

#include "camera_transport.hpp"
#include "genicam_camera.hpp"
#include "u3v_registers.hpp"
#include "usbfs_node.hpp"

namespace versavis::test {

class U3vCamera final : public UsbFunction, private rig::CameraTransport {
 public:
    U3vCamera(const rig::World& world, const rig::CameraScenario& settings,
              const rig::CameraFamily& family = rig::rig_family());
    ~U3vCamera() override;
    U3vCamera(const U3vCamera&) = delete;
    U3vCamera& operator=(const U3vCamera&) = delete;

    rig::GenicamCamera& camera() { return camera_; }

    void stall_data();
    /// The control channel takes commands and never answers.
    void mute(bool muted) { muted_ = muted; }

    const UsbDescription& description() const override { return description_; }
    void receive(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override;
    void plugged(bool in) override;

 private:
    std::uint16_t read_memory(std::span<const std::uint8_t> command, Bytes& body);
    std::uint16_t write_memory(std::span<const std::uint8_t> command, Bytes& body);
    std::uint32_t value(U3vRegister address) const;
    void set(U3vRegister address, std::uint64_t value);
    bool ready(const rig::StreamFrame& frame) const;
    void transmit(rig::StreamFrame frame) override;
    void send_leader(const rig::StreamFrame& frame);
    void send_payload(const rig::StreamFrame& frame);
    void send_trailer(const rig::StreamFrame& frame);

    UsbDescription description_;
    std::atomic<bool> muted_{false};
    std::mutex sending_;    ///< held while a frame goes to the node: an unplug waits for it
    bool plugged_ = false;  ///< guarded by sending_
    rig::GenicamCamera camera_;
    rig::CameraRegisters& registers_ = camera_.registers();
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace versavis::test
