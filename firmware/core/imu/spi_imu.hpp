// SPDX-License-Identifier: BSD-3-Clause
// The IMU on the SPI bus: sets it up, reads it at its data-ready edges or on a grid, and sets it up
// again when it fails.
#pragma once

#include "imu/imu_part.hpp"
#include "imu/imu_port.hpp"

namespace versavis::firmware {

class SpiImu final : public ImuPort {
 public:
    SpiImu(std::uint8_t port, ImuBus& bus, ChannelReports& reports)
        : ImuPort(port, reports), bus_(bus) {}

    /// With a kind that is not on this bus, nothing is read.
    void configure(const wire::ImuConfiguration& configuration, Nanoseconds now);

    /// The data-ready line rose. Pass on all edges before poll(): what is read belongs to the
    /// newest.
    void ready_edge(Nanoseconds at, Nanoseconds now);

    /// Does what is due. True: `sample` holds a new sample.
    bool poll(Nanoseconds now, wire::ImuSample& sample);

    Nanoseconds next_wake() const;

    /// Instants of the samples without data-ready.
    const Grid& grid() const { return grid_; }

    /// The rate that a configuration leads to.
    static std::uint32_t true_rate(const wire::ImuConfiguration& configuration);

 private:
    enum class State : std::uint8_t { off, set_up, running };

    /// Data-ready edges known when a reading was requested, and the first ones seen later, which
    /// may have come before it began.
    struct Edges {
        Nanoseconds newest = 0;
        std::uint32_t count = 0;
        Nanoseconds later[2] = {};
        std::size_t later_count = 0;
    };

    bool paced_by_part() const { return (configuration_.options & wire::imu_data_ready) != 0; }
    void begin_setup(Nanoseconds at);
    void next_step(Nanoseconds now);
    void check_step(const ImuReply& reply, Nanoseconds now);
    void run(Nanoseconds now);
    void expect_edge(Nanoseconds now) { silent_at_ = now + patience_; }
    void fail(wire::EventKind kind, Nanoseconds now, std::int64_t value, std::uint16_t detail);
    void start_reading(Nanoseconds at, Nanoseconds now);
    bool start(Nanoseconds at, Nanoseconds now);
    bool take(const ImuReply& reply, Nanoseconds now, wire::ImuSample& sample);
    void pace(Nanoseconds now);
    Nanoseconds stamp(unsigned reading);

    ImuBus& bus_;
    const ImuPart* part_ = nullptr;
    wire::ImuConfiguration configuration_{};
    State state_ = State::off;
    Setup setup_;
    std::size_t step_ = 0;
    Nanoseconds resume_ = 0;    ///< when the next step may begin
    Grid grid_;                 ///< unless the part paces the samples
    Nanoseconds patience_ = 0;  ///< how long its data-ready edge may fail to come
    ImuTransfer transfer_;
    bool pending_ = false;           ///< a transfer is set or under way
    Nanoseconds pending_until_ = 0;  ///< when it must have ended
    unsigned reading_ = 0;           ///< of the sample that is being read
    ImuReply replies_[max_readings];
    Edges edges_[max_readings];  ///< as each reading of the sample began
    Nanoseconds completed_ = 0;  ///< when the newest transfer was found complete
    Nanoseconds period_ = 0;     ///< of the edges, as the part was told
    unsigned fast_edges_ = 0;    ///< edges in a row that came sooner
    Nanoseconds newest_edge_ = 0;
    std::uint32_t edge_count_ = 0;
    std::uint32_t served_ = 0;   ///< edges whose samples were read, or missed
    Nanoseconds silent_at_ = 0;  ///< when the next edge must have come
};

}  // namespace versavis::firmware
