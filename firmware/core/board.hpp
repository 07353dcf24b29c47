// SPDX-License-Identifier: BSD-3-Clause
// The board: link, cameras, IMUs, light and pulses behind one poll(), on any port that implements
// the HAL.
#pragma once

#include "base/hal.hpp"
#include "camera_channel.hpp"
#include "configuration_check.hpp"
#include "edge_order.hpp"
#include "illumination.hpp"
#include "imu/spi_imu.hpp"
#include "imu/vn100.hpp"
#include "nmea_reader.hpp"
#include "noise_guard.hpp"
#include "output_queue.hpp"
#include "pps_monitor.hpp"
#include "pulse_train.hpp"
#include "time_output.hpp"
#include "transmitter.hpp"

namespace versavis::firmware {

struct Identity {
    std::uint32_t nonce;  ///< drawn at boot
    wire::ResetCause reset_cause = wire::ResetCause::power_on;
    char serial[sizeof wire::BoardHello::serial];
};

/// The whole board as one object: it takes edges, packets and IMU replies from the port, and hands
/// out triggers, light, pulses and messages. The port's main loop owns it and calls poll() and
/// next_wake(), never from an interrupt. All parts below are members, so none of them needs a lock.
class Board final : private ChannelReports, private RefusalSink, private OutputMoves {
 public:
    Board(const Hal& hal, const Identity& identity);
    Board(const Board&) = delete;
    Board& operator=(const Board&) = delete;

    /// Does what is due, a bounded part of it at once: when more is, next_wake() has passed
    /// already. Call it at next_wake(), and when the HAL says so.
    void poll();

    Nanoseconds next_wake() const { return due_; }

 private:
    void exposure(const wire::Exposure& record) override;
    void event(wire::BoardEventKind kind, std::uint8_t source, Nanoseconds at, std::int64_t value,
               std::uint16_t detail) override;
    void exposure_planned(std::uint8_t camera, Nanoseconds start, Nanoseconds duration) override;
    void refuse(const wire::Refusal& refusal) override;
    void moved(unsigned output, bool level, Nanoseconds asked, Nanoseconds left) override;

    Nanoseconds find_timers() const;
    Nanoseconds find_next_wake() const;
    void poll_link();
    void poll_edges(Nanoseconds now);
    void poll_cameras(Nanoseconds now);
    void poll_outputs(Nanoseconds now);
    void poll_storage(Nanoseconds now);
    void poll_configuration(Nanoseconds now);
    void poll_imus(Nanoseconds now);
    void poll_nmea();
    void take_sentence();
    void poll_health(Nanoseconds now);
    void take_edge(const Edge& edge, Nanoseconds now);
    void take_exposure_edge(const Edge& edge);
    void settle_exposures(Nanoseconds known);
    void judge_exposure_edge(const Edge& edge);
    void grid_moved();
    void take_pulse(wire::PulseInput input, Nanoseconds at);
    void handle(const wire::Packet& packet, Nanoseconds received);
    void greet(const wire::HostHello& hello);
    wire::BoardHello introduction() const;
    void configure(const wire::Configuration& configuration);
    void apply(const wire::Configuration& configuration, Nanoseconds now);
    void configure_camera(unsigned camera);
    void change_cameras();
    std::uint8_t changeable(const wire::Configuration& configuration) const;
    std::uint8_t unready() const;
    bool may_change(Nanoseconds now) const;
    void apply_imus(const wire::Configuration& configuration, Nanoseconds now);
    Routing::Switched apply_routes(bool force);
    void apply_nmea();
    void begin_trains(Nanoseconds now);
    void restore();
    void answer_configuration(std::uint32_t id, wire::ConfigurationStatus status);
    void start(const wire::Start& start);
    void start_cameras(std::uint8_t cameras, std::uint8_t flags);
    void stop(std::uint8_t cameras);
    void align(const wire::AlignGrid& wanted);
    void ignore(const wire::Log& why);
    void take(const wire::TimeOutput& message);
    bool possible(const wire::TimeOutput& message, Nanoseconds now) const;
    bool is_time_output(unsigned output) const;
    void poll_time_outputs(Nanoseconds now);
    void release_time_outputs(const wire::Configuration& configuration, Nanoseconds now);
    void switch_slaves();
    void edges_lost(std::uint32_t lines);
    void follow_sync(Nanoseconds at);
    bool any_running() const;
    bool idle(std::uint8_t cameras) const;
    template <class T>
    void send(const T& message);

    // Sorted by size: the processor reaches what is near the beginning with the shortest code.
    bool configuring_ = false;
    bool greeted_ = false;
    bool storing_ = false;
    bool outputs_blocked_ = false;
    bool more_ = false;           ///< to do at once
    bool dirty_ = true;           ///< cameras, light and outputs may have work to do
    std::uint8_t unsettled_ = 0;  ///< exposure lines that have not settled
    std::uint8_t refused_ = 0;
    std::uint8_t exposing_ = 0;  ///< cameras whose exposure line is active
    std::uint8_t masters_ = 0;   ///< cameras that slaves follow
    std::uint8_t slaves_ = 0;    ///< slaves that are to run
    std::uint8_t routed_ = 0;    ///< slaves whose triggers follow their masters
    std::uint8_t changing_ = 0;  ///< cameras that the new configuration changes; 0: all is new
    wire::Start on_sync_{};      ///< waits for a sync pulse
    bool grid_on_sync_ = false;  ///< so does the grid, whether cameras do or not
    std::uint32_t checked_id_ = 0;
    std::uint32_t event_sequence_ = 0;
    Nanoseconds timers_ = 0;   ///< when cameras, light and outputs have something to do in any case
    Nanoseconds settled_ = 0;  ///< all edges before are known
    Nanoseconds output_progress_ = 0;
    Nanoseconds next_health_;
    Nanoseconds due_ = 0;  ///< when poll() has something to do next
    Nanoseconds polled_;
    Nanoseconds next_stray_ = 0;  ///< when the next stray edge may be reported
    Nanoseconds configure_at_;    ///< at the latest
    Nanoseconds last_sync_ = INT64_MIN / 2;
    Hal hal_;
    Identity identity_;
    std::uint32_t pulses_[wire::pulse_input_count] = {};
    EchoFilter echoes_[wire::pulse_input_count];
    wire::Health health_{};
    PulseTrain sync_;
    PulseTrain test_;
    GridClock grid_clock_;
    GridClock board_clock_;  ///< runs as board time does
    NoiseGuard noise_;
    NmeaReader nmea_;
    wire::Configuration configuration_{};  ///< in force
    wire::Configuration wanted_;           ///< waits for the last pulses and exposures to end
    PpsMonitor pps_;
    TimeOutput time_outputs_[wire::time_output_count];
    EdgeOrder waiting_;  ///< edges of exposure lines, for another line to settle
    Illumination light_;
    Vn100 uart_imu_;
    SpiImu spi_imu_;
    wire::Decoder decoder_;
    CameraChannel cameras_[camera_count];
    OutputQueue outputs_;
    Transmitter transmitter_;
};

}  // namespace versavis::firmware
