// SPDX-License-Identifier: BSD-3-Clause
// One camera: places its triggers so that the middles of its exposures lie on the grid, and records what it
// did.
#pragma once

#include <cstddef>
#include <cstdint>

#include "grid.hpp"
#include "hal.hpp"
#include "output_queue.hpp"
#include "versavis/wire/messages.hpp"

namespace versavis::firmware {

/// Where a channel reports to.
struct ChannelReports {
    virtual void exposure(const wire::Exposure& record) = 0;
    virtual void event(wire::EventKind kind, std::uint8_t source, Nanoseconds at, std::int64_t value) = 0;

 protected:
    ~ChannelReports() = default;
};

class CameraChannel {
 public:
    CameraChannel(std::uint8_t camera, OutputQueue& outputs, ChannelReports& reports)
        : camera_(camera), outputs_(outputs), reports_(reports) {}

    void configure(const wire::CameraConfiguration& configuration, Nanoseconds now);

    /// Begins triggering on the grid through `origin`, the first tick not before `now`; numbers go on.
    void start(Nanoseconds origin, Nanoseconds now, bool pattern);

    /// Pulses that were decided are still sent, and recorded.
    void stop() { running_ = false; }
    bool running() const { return running_; }

    void announce(std::uint64_t trigger, Nanoseconds exposure);

    /// Takes an edge of the exposure line; edges come in order.
    void edge(Nanoseconds at, bool level);

    /// Edges were lost: an end that comes now may belong to another exposure than the start that was seen.
    void edges_lost();

    /// Decides the triggers that are due and gives up exposures that did not happen.
    void poll(Nanoseconds now);

    /// When poll() has something to do next; INT64_MAX: never.
    Nanoseconds next_wake() const;

 private:
    /// A trigger that was sent and whose record is not complete.
    struct Flight {
        wire::Exposure record;
        Nanoseconds expected;  ///< duration
    };
    static constexpr std::size_t max_flights = 4;

    Nanoseconds trigger_time() const;
    Nanoseconds expected_exposure() const;
    Nanoseconds busy_until(Nanoseconds now) const;
    Nanoseconds deadline(const Flight& flight) const;
    bool in_pattern_gap() const;
    void decide(Nanoseconds now);
    void send_trigger(Nanoseconds at, Nanoseconds now);
    void start_edge(Nanoseconds at);
    void end_edge(Nanoseconds at);
    void expire(Nanoseconds now);
    void finish(std::size_t index);
    void predict_edges(Flight& flight) const;
    bool has(wire::CameraFlag flag) const { return (configuration_.flags & flag) != 0; }

    std::uint8_t camera_;
    OutputQueue& outputs_;
    ChannelReports& reports_;
    wire::CameraConfiguration configuration_{};
    Grid grid_;
    bool running_ = false;
    std::uint64_t trigger_ = 0;     ///< pulses sent since boot
    std::uint64_t first_tick_ = 0;  ///< of this run, where the pattern begins
    bool pattern_ = false;
    Nanoseconds expected_ = 0;
    std::uint64_t expected_since_ = 0;  ///< trigger that set `expected_`
    std::uint64_t announced_from_ = 0;  ///< 0: nothing announced
    Nanoseconds announced_ = 0;
    Nanoseconds last_end_ = INT64_MIN / 2;  ///< end of the newest finished exposure
    Flight flights_[max_flights] = {};
    std::size_t flight_count_ = 0;
};

}  // namespace versavis::firmware
