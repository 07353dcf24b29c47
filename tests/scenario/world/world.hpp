// SPDX-License-Identifier: BSD-3-Clause
// The board in virtual time, wired to models of cameras, IMUs and pulse sources, and to a host;
// keeps what really happened, and judges the reports by it.
#pragma once

#include <cstdlib>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera_model.hpp"
#include "emulated_board.hpp"
#include "host_model.hpp"
#include "inertial.hpp"
#include "native_board.hpp"
#include "trace.hpp"
#include "vn100_device.hpp"

namespace versavis::scenario {

/// Regular pulses into the board, such as PPS.
struct PulseSource {
    std::uint8_t input;
    Nanoseconds origin;
    double period_ns;  ///< in board time
    Nanoseconds width = 100 * us;
    bool falling = false;  ///< low pulses
    std::uint64_t count = 0;
    std::vector<Nanoseconds> fired{};

    Nanoseconds next() const;
};

struct Interval {
    Nanoseconds on;
    Nanoseconds off;
};

class World {
 public:
    /// The board runs on `model`; without one, on what the variable VERSAVIS_PORT names. `tap` sees
    /// what its core does.
    explicit World(std::uint64_t seed = 1, std::optional<firmware::PortModel> model = {},
                   firmware::CoreTap* tap = nullptr);

    /// A motion that is easy to recognise, and slow compared with every IMU.
    static devices::Inertial motion(Nanoseconds at);

    // What is there; before connect().
    CameraModel& add_camera(unsigned output, CameraSettings settings = {},
                            std::uint32_t rate_uhz = 20'000'000);
    void add_imu(std::unique_ptr<devices::SpiImuDevice> device, wire::ImuKind kind, double rate_hz,
                 bool data_ready);
    devices::Vn100Device& add_vn100(double rate_hz, bool data_ready);
    void add_pulses(wire::PulseInput input, Nanoseconds origin, double period_ns,
                    Nanoseconds width = 100 * us);
    /// No more pulses from any source.
    void stop_pulses() { pulses_.clear(); }
    /// Endless edges at an input, `period` apart.
    void add_noise(std::uint8_t input, Nanoseconds period, Nanoseconds from, Nanoseconds to);

    // What the host does.
    template <class T>
    void send(const T& message) {
        wire::Frame frame{};
        wire::encode(message, host_nonce_, host_sequence_++, frame);
        send_bytes({frame.bytes, frame.size});
    }
    void send_bytes(std::span<const std::uint8_t> bytes);
    void connect();
    /// Sends `configuration`. False: it was refused.
    bool configure();
    void start(std::uint8_t cameras = 0xF, std::uint8_t flags = 0);
    void stop(std::uint8_t cameras = 0xF);
    /// connect(), configure() and start().
    bool begin(std::uint8_t flags = 0);
    /// The host reads nothing for `duration` from now.
    void stall_host(Nanoseconds duration) { host_reads_from_ = now_ + duration; }
    /// Bytes that the host reads, how often, and what the board can hold of them.
    void set_link(Nanoseconds interval, std::size_t bytes, std::size_t capacity);

    void run(Nanoseconds duration);
    /// Stops the cameras and waits for everything still to come.
    void finish();
    /// The board's code stalls for `duration`; everything else continues.
    void stall_board(Nanoseconds duration);
    /// The board restarts; what the host knows stays.
    void reboot(wire::ResetCause cause);

    Nanoseconds now() const { return now_; }
    firmware::VirtualBoard& board() { return *board_; }
    /// What only a board in this process can do. Throws on the emulated chip.
    firmware::NativeBoard& native_board();
    Inbox& inbox() { return host_.inbox; }
    CameraModel& camera(unsigned output) { return *cameras_.at(output); }
    /// Lines over time, recorded since record_trace().
    const Trace& trace() const { return trace_; }
    void record_trace() { tracing_ = true; }
    const std::vector<Interval>& lights() const { return lights_; }
    const std::vector<Nanoseconds>& rises(unsigned pin) const { return rises_[pin]; }
    int reboots() const { return reboots_; }
    devices::SpiImuDevice& spi_imu() { return *spi_imu_; }
    /// Every data-ready edge of IMU 0 is followed by another one after so long; 0: none is.
    void set_ready_echo(Nanoseconds after) { ready_echo_ = after; }
    /// The accelerometer's data-ready line is cut, or whole.
    void set_accel_ready_wired(bool wired) { accel_ready_wired_ = wired; }
    /// The SPI bus reads only this byte, or what the part sends; on I2C nobody acknowledges.
    void set_dead_bus(std::optional<std::uint8_t> level) { dead_bus_ = level; }

    /// True time of a grid point.
    Nanoseconds grid_time(unsigned camera, std::uint64_t tick) const;
    /// The calls of the port take time: what does not fit may come late, and says so.
    bool is_slow() const { return model_.call_ns > 0; }
    /// How far what the port does may be from what was asked, as coarse as it is: half a grain of
    /// an output, a step between two words, and a grain of the stamps.
    Nanoseconds rounding() const;
    /// How much later than its grid point a reading of an IMU may begin: on the chip, behind
    /// another interrupt.
    Nanoseconds reading_delay() const { return chip_ ? 2 * us : 0; }
    /// As the port stamps it. An edge reaches the emulated chip with its next cycle.
    Nanoseconds stamped(Nanoseconds at) const {
        if (chip_) return rig::EmulatedBoard::edge_time(at);
        return at / model_.edge_grain_ns * model_.edge_grain_ns;
    }
    /// A stamp is that of an edge at `at`.
    bool is_stamp(Nanoseconds stamp, Nanoseconds at) const {
        return std::abs(stamp - stamped(at)) <= stamp_error_;
    }
    /// Middle of a measured exposure relative to its grid point, as exact as the port allows; 0 for
    /// one that says it was late on a slow port.
    Nanoseconds grid_error(const wire::Exposure& record) const;
    const wire::Exposure& record(unsigned camera, std::uint64_t trigger);

    // What judge() tolerates.
    bool drops_allowed = false;  ///< records and events that the board had to drop
    bool busy_allowed = false;   ///< triggers into a busy camera that nobody could foresee
    bool gaps_allowed =
        false;  ///< grid points without pulse or event: pattern, slow start, restarts

    /// Compares everything that was reported with everything that happened; empty: all is right.
    std::string judge();

    wire::Configuration configuration{};

 private:
    void outputs_changed(Nanoseconds at, std::uint32_t pins);
    void make_board(wire::ResetCause cause);
    void show(const std::string& line, Nanoseconds at, bool level);
    void read_link();
    Nanoseconds next_event() const;
    void fire_events(Nanoseconds at);
    void fire_spi_ready();
    void fire_accel_ready();
    void pulse_ready(std::uint8_t input, Nanoseconds width);
    void fire_uart_sample();
    void uart_sent(Nanoseconds at, std::uint32_t baud, std::span<const std::uint8_t> bytes);

    void judge_camera(unsigned camera, std::string& out);
    void judge_record(const wire::Exposure& record, const TruePulse& pulse, std::string& out) const;
    void judge_ticks(unsigned camera, std::string& out);
    void judge_imu(unsigned port, std::string& out);
    void judge_accel_age(const wire::ImuSample& sample, std::string& out) const;
    void judge_pulses(std::string& out);
    void judge_light(std::string& out);

    std::uint64_t seed_;
    firmware::PortModel model_;
    /// How far stamps may be from those of the model: of the chip, what the firmware promises.
    Nanoseconds stamp_error_ = 0;
    firmware::CoreTap* tap_;
    Nanoseconds now_ = 0;
    std::vector<std::uint8_t> flash_;
    std::map<unsigned, std::unique_ptr<CameraModel>> cameras_;
    std::unique_ptr<devices::SpiImuDevice> spi_imu_;
    /// When it takes new data on the SPI bus, since the instant that is the key.
    std::map<Nanoseconds, devices::UpdateTimes> imu_updates_;
    std::optional<devices::Vn100Device> uart_imu_;
    std::optional<std::uint8_t> dead_bus_;
    std::vector<PulseSource> pulses_;
    Nanoseconds next_ready_ = firmware::never;
    bool ready_fires_ = false;
    Nanoseconds next_accel_ready_ = firmware::never;
    bool accel_ready_fires_ = false;
    bool accel_ready_wired_ = true;
    Nanoseconds ready_echo_ = 0;
    Nanoseconds next_sample_ = firmware::never;
    std::vector<Nanoseconds> ready_times_[2];
    HostModel host_;
    std::uint32_t host_nonce_ = 0x4057;
    std::uint32_t host_sequence_ = 0;
    Nanoseconds next_read_ = ms;
    Nanoseconds read_interval_ = ms;
    std::size_t read_size_ = 832;  ///< of the 1216 that a millisecond of full speed can carry
    std::size_t link_capacity_ = 512;
    Nanoseconds host_reads_from_ = 0;
    Nanoseconds grid_origin_ = 0;
    std::uint32_t pins_ = 0;
    std::vector<Interval> lights_;
    std::vector<Nanoseconds> rises_[8];
    int reboots_ = 0;
    Trace trace_;
    bool tracing_ = false;
    std::unique_ptr<rig::EmulatedChip> chip_;
    std::unique_ptr<firmware::VirtualBoard> board_;
};

}  // namespace versavis::scenario
