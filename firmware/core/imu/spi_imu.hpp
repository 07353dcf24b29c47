// SPDX-License-Identifier: BSD-3-Clause
// The IMU on the SPI or I2C bus: sets it up, reads it at its data-ready edges or on a grid, and
// sets it up again when it fails.
#pragma once

#include "imu/imu_part.hpp"
#include "imu/imu_port.hpp"
#include "imu/ready_edges.hpp"

namespace versavis::firmware {

/// Sets up an IMU on SPI or I2C by its ImuPart, reads it at each data-ready edge or on the board's
/// grid, and checks and stamps its samples. Part of Board, called from Board::poll() only; the port
/// runs the transfers by interrupts.
class SpiImu final : public ImuPort {
 public:
    SpiImu(std::uint8_t port, ImuBus& bus, ChannelReports& reports);

    /// With a kind that is not on this bus, nothing is read.
    void configure(const wire::ImuConfiguration& configuration, Nanoseconds now);

    /// The data-ready line rose, or that of the accelerometer.
    void ready_edge(Nanoseconds at, Nanoseconds now);
    void accel_edge(Nanoseconds at) { accel_edges_.add(at); }
    /// Some edges were not passed on: until the next one, nobody knows which sample is read.
    void edges_lost();

    /// Collects what was read. Call it before the edges are passed on: those that came before the
    /// reading are then known in poll().
    void collect(Nanoseconds now);

    /// Does what is due; all edges before `settled` were passed on. True: `sample` holds a new
    /// sample.
    bool poll(Nanoseconds now, Nanoseconds settled, wire::ImuSample& sample);

    /// When poll() has something to do next; it learns of edges `lag` after they came.
    Nanoseconds next_wake(Nanoseconds lag) const;

    /// Instants of the samples without data-ready.
    const Grid& grid() const { return grid_; }
    std::uint32_t take_glitches() {
        return ready_edges_.take_echoes() + accel_edges_.take_echoes();
    }

    /// The rate that a configuration leads to.
    static std::uint32_t true_rate(const wire::ImuConfiguration& configuration);

 private:
    enum class State : std::uint8_t { off, set_up, running };
    enum class Job : std::uint8_t { none, armed, collected };

    bool has(wire::ImuOption option) const { return (configuration_.options & option) != 0; }
    bool paced_by_part() const { return has(wire::imu_data_ready); }
    void begin_setup(Nanoseconds at);
    void next_step(Nanoseconds now);
    void check_step(Nanoseconds now);
    void run(Nanoseconds now);
    void expect_edge(Nanoseconds now) { silent_at_ = now + patience_; }
    void fail(wire::BoardEventKind kind, Nanoseconds now, std::int64_t value, std::uint16_t detail);
    void adapt(ImuTransfer& transfer) const;
    void arm();
    void arm_reading(std::uint8_t input, Nanoseconds after, unsigned readings);
    bool take(Nanoseconds now, wire::ImuSample& sample);
    bool refused() const;
    bool drop(wire::BoardEventKind kind, Nanoseconds now);
    bool stamp(const ImuReply& reply, Nanoseconds now, wire::ImuSample& sample);
    void stamp_accel(wire::ImuSample& sample) const;
    void pace(Nanoseconds now);

    ImuBus& bus_;
    const ImuPart* part_ = nullptr;
    wire::ImuConfiguration configuration_{};
    State state_ = State::off;
    std::size_t step_ = 0;
    Nanoseconds resume_ = 0;    ///< when the next step may begin
    Grid grid_;                 ///< unless the part paces the samples
    Nanoseconds patience_ = 0;  ///< how long its data-ready edge may fail to come
    Job job_state_ = Job::none;
    bool job_reads_ = false;     ///< its transfers are those that begin a sample
    Nanoseconds job_until_ = 0;  ///< when it must have ended; never: it waits for an edge
    unsigned readings_ = 0;      ///< of the sample that is being read
    Nanoseconds period_ = 0;     ///< of the edges, as configured in the part
    Nanoseconds accel_period_ = 0;
    unsigned fast_edges_ = 0;    ///< edges in a row that came sooner
    std::uint32_t served_ = 0;   ///< edges whose samples were read, or missed
    Nanoseconds served_at_ = 0;  ///< the newest of them
    bool edges_lost_ = false;    ///< since then
    Nanoseconds silent_at_ = 0;  ///< when the next edge must have come
    Nanoseconds began_ = 0;      ///< when it was set up
    Setup setup_;
    ReadyEdges ready_edges_;
    ReadyEdges accel_edges_;
    ImuJob job_;
    ImuReply replies_[max_readings];  ///< of the sample that is being read
};

}  // namespace versavis::firmware
