// SPDX-License-Identifier: BSD-3-Clause
// The board: link, cameras and IMU behind one poll(), on any port that offers the HAL.
#pragma once

#include "camera_channel.hpp"
#include "hal.hpp"
#include "imu_sampler.hpp"
#include "output_queue.hpp"
#include "versavis/wire/packet.hpp"

namespace versavis::firmware {

struct Identity {
    std::uint32_t nonce = 0;  ///< drawn at boot
    wire::ResetCause reset_cause = wire::ResetCause::power_on;
    char serial[16] = {};
};

class Board final : private ChannelReports {
 public:
    Board(const Hal& hal, const Identity& identity);
    Board(const Board&) = delete;
    Board& operator=(const Board&) = delete;

    /// Does all that is due. Call it at next_wake(), when bytes or edges came, and when a burst completed.
    void poll();

    Nanoseconds next_wake() const;

 private:
    void exposure(const wire::Exposure& record) override;
    void event(wire::EventKind kind, std::uint8_t source, Nanoseconds at, std::int64_t value) override;

    void poll_link();
    void poll_edges();
    void poll_imu(Nanoseconds now);
    void poll_health(Nanoseconds now);
    void handle(const wire::Packet& packet, Nanoseconds received);
    void greet(const wire::HostHello& hello);
    void configure(const wire::Configuration& configuration);
    void start(const wire::Start& start);
    void stop(std::uint8_t cameras);
    void answer_clock(const wire::ClockRequest& request, Nanoseconds received);
    bool any_running() const;
    template <class T>
    void send(const T& message);

    Hal hal_;
    Identity identity_;
    OutputQueue outputs_;
    CameraChannel cameras_[camera_count];
    ImuSampler imu_;
    wire::Configuration configuration_{};
    wire::Decoder decoder_;
    wire::Frame frame_{};
    bool greeted_ = false;
    Nanoseconds grid_origin_ = 0;
    Nanoseconds next_health_ = 0;
    std::uint32_t sequence_ = 0;
    std::uint32_t event_sequence_ = 0;
    wire::Health health_{};
};

}  // namespace versavis::firmware
