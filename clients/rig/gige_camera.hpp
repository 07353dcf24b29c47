// SPDX-License-Identifier: BSD-3-Clause
// GigE Vision as a transport of the emulated camera: control server, stream and events.
#pragma once

#include <netinet/in.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "camera_transport.hpp"
#include "event_sender.hpp"
#include "genicam_camera.hpp"
#include "gige_registers.hpp"
#include "gvsp_transmitter.hpp"
#include "posix/file_descriptor.hpp"

namespace versavis::rig {

class GigeCamera final : private CameraTransport {
 public:
    /// Binds the control port. Error: the address does not exist or is taken.
    static Expected<std::unique_ptr<GigeCamera>> create(const World& world,
                                                        const CameraScenario& settings);
    ~GigeCamera() override;
    GigeCamera(const GigeCamera&) = delete;
    GigeCamera& operator=(const GigeCamera&) = delete;

    GenicamCamera& camera() { return camera_; }

 private:
    GigeCamera(const World& world, const CameraScenario& settings, const CameraFamily& family,
               FileDescriptor socket, FileDescriptor broadcast_socket);

    void transmit(StreamFrame frame) override { transmitter_.transmit(std::move(frame)); }
    void forget_frames() override { transmitter_.forget(); }
    void send_event(HostTime due, const TimedEvent& event) override { events_.send(due, event); }

    void serve();
    void receive(int socket);
    void send_answers();
    void handle(std::span<const std::uint8_t> packet, const sockaddr_in& from);
    void reply(std::span<const std::uint8_t> packet, std::uint16_t status,
               const std::vector<std::uint8_t>& body, const sockaddr_in& to, bool later = false);
    std::optional<std::uint16_t> take_action(std::span<const std::uint8_t> packet);
    std::vector<std::uint8_t> answer(std::uint16_t command, std::span<const std::uint8_t> body,
                                     const sockaddr_in& from, std::uint16_t& status);
    std::uint16_t write_register(std::uint32_t address, std::uint32_t value,
                                 const sockaddr_in& from);
    bool in_control(const sockaddr_in& from) const;
    void lose_controller();
    sockaddr_in destination(GigeRegister address, GigeRegister port) const;
    void configure_stream();
    void configure_messages();
    bool pending(std::uint16_t command, std::span<const std::uint8_t> body) const;

    struct Answer {
        HostTime due;
        std::vector<std::uint8_t> packet;
        sockaddr_in to{};
    };

    Hostility hostility_;
    Duration answer_time_;  ///< from question to answer
    std::deque<Answer> answers_;
    FileDescriptor socket_;
    FileDescriptor broadcast_socket_;  ///< receives discovery; none on loopback
    GvspTransmitter transmitter_;
    EventSender events_;
    GenicamCamera camera_;
    CameraRegisters& registers_ = camera_.registers();
    sockaddr_in controller_{};
    HostTime last_contact_;
    std::atomic<bool> stop_{false};
    std::thread server_;
};

}  // namespace versavis::rig
