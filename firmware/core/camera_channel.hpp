// SPDX-License-Identifier: BSD-3-Clause
// One camera: places its triggers so that the middles of its exposures lie on the grid, or follows
// its master, and records what it did.
#pragma once

#include "announcements.hpp"
#include "base/grid.hpp"
#include "exposure_tracker.hpp"
#include "glitch_filter.hpp"
#include "grid_clock.hpp"
#include "output_queue.hpp"

namespace versavis::firmware {

/// Decides each trigger of one camera, with its exposure compensation, start pattern and slave
/// routing, and turns the edges of its exposure line into records. Part of Board, called from
/// Board::poll() only.
class CameraChannel {
 public:
    CameraChannel(std::uint8_t camera, const GridClock& clock, OutputQueue& outputs,
                  ChannelReports& reports)
        : camera_(camera),
          clock_(clock),
          outputs_(outputs),
          reports_(reports),
          tracker_(camera, reports) {}

    /// Only while stopped and idle. Numbers continue, and ticks of the same rate. Triggers are
    /// decided `lead` sooner than the outputs require.
    void configure(const wire::CameraConfiguration& configuration, Nanoseconds lead);

    /// Begins triggering at the first grid point that can be met after `now`; flags:
    /// wire::StartFlag. A running channel restarts its pattern.
    void start(Nanoseconds now, std::uint8_t flags);

    /// Pulses that were already decided are still sent and recorded.
    void stop();

    /// A slave: pulses of its master are passed on from `at`; until `at`, no longer. Not `clean`:
    /// one may be cut.
    void route(Nanoseconds at, bool clean);
    void unroute(Nanoseconds at, bool clean);

    bool running() const { return running_; }
    bool slow() const { return running_ && (start_flags_ & wire::start_slow) != 0; }
    bool is_slave() const { return enabled() && has(wire::camera_slave); }
    /// True: not waiting for any exposure.
    bool idle() const { return tracker_.empty(); }
    /// Stops waiting for exposures.
    void give_up() { tracker().give_up(); }

    /// Restarts the grid, its ticks from 0; only while the camera is not running.
    void grid_began() { next_tick_ = 0; }
    /// The clock of the grid changed.
    void grid_moved() { plan(); }

    /// From `trigger` on, exposures are expected to last `exposure`, until others are measured.
    void announce(std::uint64_t trigger, Nanoseconds exposure);

    /// An edge of the exposure line; edges come in order.
    void edge(Nanoseconds at, bool level) { filter_.edge(at, exposing(level)); }
    /// True, for each edge that counts, once all before `settled` are known.
    bool take_edge(Nanoseconds settled, Nanoseconds& at, bool& exposing);
    /// An edge waits for whether it counts.
    bool is_bouncing() const { return filter_.next_wake() != never; }
    /// Before this instant no more edge will count.
    Nanoseconds settled(Nanoseconds settled) const { return filter_.settled(settled); }
    /// The exposure line of this camera changed, or that of this slave's master: `tick` is that of
    /// the master.
    void exposure_edge(Nanoseconds at, bool exposing);
    void master_edge(Nanoseconds at, bool exposing, std::uint64_t tick);

    void edges_lost();
    /// The trigger due at `asked` left at `left`.
    void moved(Nanoseconds asked, Nanoseconds left, bool late) {
        tracker().moved(asked, left, late);
    }

    /// Decides the triggers that are due and gives up on exposures that did not happen. The edges
    /// that count before `settled` are known. At most `decisions_a_poll` triggers are decided at
    /// once.
    void poll(Nanoseconds now, Nanoseconds settled);

    /// When poll() has something to do next; it learns of edges `lag` after they came.
    Nanoseconds next_wake(Nanoseconds lag) const;

    bool enabled() const { return has(wire::camera_enabled); }
    bool exposing(bool level) const { return level != has(wire::camera_strobe_inverted); }
    bool has_strobe() const { return enabled() && !has(wire::camera_no_strobe); }
    /// Camera whose exposure line triggers this one; not_routed: none.
    std::uint8_t master() const { return is_slave() ? configuration_.master : not_routed; }
    bool trigger_inverted() const { return has(wire::camera_trigger_inverted); }
    std::uint64_t tick_at(Nanoseconds at) const { return tracker_.tick_at(at); }
    std::uint32_t skipped() const { return skipped_; }
    std::uint32_t take_glitches() { return filter_.take_left_out(); }

 private:
    /// If lower, a start pattern at 1 kHz takes more polls.
    static constexpr unsigned decisions_a_poll = 2;

    Nanoseconds period() const { return grid_.period(); }
    /// To change it.
    ExposureTracker& tracker() {
        dirty_ = true;
        return tracker_;
    }
    Nanoseconds expected_exposure() const;
    void plan();
    void advance(std::int64_t ticks);
    bool wanted(std::uint64_t tick) const;
    std::int64_t wanted_among(std::uint64_t since_start, std::int64_t ticks) const;
    void decide(Nanoseconds now, Nanoseconds settled);
    void skip(wire::SkipReason reason);
    void skip_late(Nanoseconds late_by);
    void send_trigger(Nanoseconds now);
    std::uint16_t phase_flags() const;
    wire::Exposure new_record(Nanoseconds at, std::uint64_t tick);
    bool has(wire::CameraFlag flag) const { return (configuration_.flags & flag) != 0; }

    std::uint8_t camera_;
    std::uint8_t start_flags_ = 0;
    bool running_ = false;
    bool uncounted_ = false;  ///< pulses of this slave may have been missed
    bool dirty_ = true;       ///< the tracker changed since `expiry_` was asked for
    const GridClock& clock_;
    OutputQueue& outputs_;
    ChannelReports& reports_;
    std::uint32_t skipped_ = 0;
    Nanoseconds trigger_at_ = 0;             ///< of the next grid point, as things are
    Nanoseconds decide_at_ = never;          ///< and when it is decided
    Nanoseconds expiry_ = 0;                 ///< next deadline of the tracker
    std::uint64_t trigger_ = 0;              ///< pulses sent since boot
    std::uint64_t first_tick_ = 0;           ///< of this run, where the pattern begins
    std::uint64_t next_tick_ = 0;            ///< the first not decided yet
    Nanoseconds pulse_end_ = INT64_MIN / 2;  ///< of the newest pulse
    Nanoseconds routed_from_ = never;        ///< of a slave: it gets the pulses between these
    Nanoseconds routed_until_ = never;
    Nanoseconds lead_ = 0;
    Nanoseconds expected_ = 0;
    std::uint64_t expected_since_ = 1;  ///< trigger that set `expected_`
    Grid grid_;                         ///< in grid time
    wire::CameraConfiguration configuration_{};
    GlitchFilter filter_;
    Announcements announcements_;
    ExposureTracker tracker_;
};

}  // namespace versavis::firmware
