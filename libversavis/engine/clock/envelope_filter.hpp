// SPDX-License-Identifier: BSD-3-Clause
// Board time to host time from stamped messages: a Bayesian filter on the lower edges of the
// delays.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/clock/asymmetry.hpp"
#include "engine/clock/delay_edge.hpp"
#include "engine/clock/estimate.hpp"
#include "engine/clock/gaussian_state.hpp"
#include "engine/clock/messages.hpp"
#include "engine/plausibility/persistence.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

/// A message that was used, as the smoother wants it.
struct EdgeSite {
    OffsetSample sample;
    Direction direction = Direction::to_host;
    double scale_ns = 0;
    std::uint64_t restarts = 0;  ///< of the filter before this message
};

/// Method: within a slot that grows from one message to 2 s, the shortest delay of each direction
/// is kept. Neither can be below its edge, the shortest delay that the link has; so each pushes the
/// estimate when it comes close to the edge, by as much as the spread of the last slots' delays
/// justifies (moment matching of a Gaussian with an exponentially modified one; T. Minka,
/// Expectation propagation for approximate Bayesian inference, 2001), and by less in the first
/// slots, which share the load of the host (a tempered likelihood). Delays far above the edge count
/// for nothing, in whatever direction and however many. Nothing is gated out: outliers widen the
/// state before it is used, and messages that arrived before they were sent restart it. A pure
/// function of its input stamps. Not thread-safe; Translator calls it under its lock.
class EnvelopeFilter {
 public:
    /// In the order in which they became available. Before the first exchange one-way messages are
    /// ignored, and so is an exchange whose round trip is not positive. `denied`: the board's other
    /// messages show that its times are wrong, so nothing begins with it.
    void add(const Exchange& exchange, bool denied = false);
    void add(const OneWay& message);

    /// Other messages contradict the exchanges by so much, from now on, or allow them to be off.
    /// While they are contradicted the estimate goes on without them.
    void doubt(Duration by, Duration allowance);

    /// The board restarted: its clock starts over, with the same crystal and link.
    void board_restarted();

    /// It stepped while the board ran: the next exchange begins the estimate anew.
    void clock_stepped();

    /// A message that is no exchange, and took as long as usual, shows that the board's clock did
    /// not step.
    void clock_continues() { continued_ = true; }

    /// A measured asymmetry takes the place of the presumed one, and of the allowance for it.
    void set_asymmetry(const std::optional<Asymmetry>& asymmetry) { asymmetry_ = asymmetry; }

    /// What is subtracted while none is measured, by how sharply the delays of each direction break
    /// off; else 0. What measures an asymmetry adds it to the estimate.
    Duration presumed_asymmetry() const;

    /// Host time of `board`, for instants near the newest message or later.
    HostEstimate translate(BoardTime board) const;

    bool initialised() const { return begun_; }
    bool confirmed() const { return confirmed_; }  ///< a second exchange agrees with the first
    /// By the newest exchange, or by other messages.
    bool contradicted() const { return contradictions_ > 0 || doubt_ > Duration{} || !confirmed_; }
    std::uint64_t exchanges() const { return exchanges_; }
    std::uint64_t comparisons() const { return comparisons_; }  ///< without those at once
    std::uint64_t one_way_messages() const { return one_way_messages_; }
    std::uint64_t restarts() const { return restarts_; }
    std::uint64_t surprises() const { return surprises_; }  ///< delays well below the edge
    std::uint64_t slots() const { return slots_; }
    double skew() const { return state_.mean[1]; }  ///< host clock against board clock, ns/s
    double skew_ppm() const { return skew() * 1e-3; }
    double skew_sigma_ppm() const;
    Duration last_residual() const {
        return last_residual_;
    }  ///< newest midpoint less the estimate
    Duration last_innovation() const {
        return last_innovation_;
    }  ///< by which the newest slot moved it
    Duration last_round_trip() const { return last_round_trip_; }
    Duration smallest_round_trip() const;  ///< of the last five to ten minutes
    BoardTime last_contact() const { return last_contact_; }

    /// From now on all that is used is appended there, too; it must outlive the filter.
    void record(std::vector<EdgeSite>& sites) { sites_ = &sites; }

 private:
    /// The estimate while nothing was in doubt.
    struct Past {
        GaussianState state;
        DelayEdge up;
        DelayEdge down;
        BoardTime at;
    };

    void begin(const Exchange& exchange, Duration round_trip);
    void restart(const Exchange& exchange, Duration round_trip);
    bool contradicts(const OffsetSample& sample, const DelayEdge& edge);
    bool goes_back(BoardTime board) const;
    double relative_ns(const OffsetSample& sample) const;
    double delay_ns(const OffsetSample& sample, const DelayEdge& edge) const;
    void close_slot_if_due(BoardTime now);
    void close_slot(BoardTime now);
    void follow_rise();
    void follow_fall(const OffsetSample& up, const OffsetSample& down);
    void shift_level(double by_ns);
    void take_back(Duration doubt);
    void keep_past();
    void use(const OffsetSample& sample, DelayEdge& edge);
    void move(const OffsetSample& sample, const DelayEdge& edge);
    void remember_round_trip(BoardTime now, Duration round_trip);

    bool begun_ = false;
    bool confirmed_ = false;
    bool reset_ = false;  ///< what was known before is void but for the skew
    Duration base_;       ///< host minus board time that the state's offset counts from
    BoardTime reference_;
    GaussianState state_;
    DelayEdge up_{Direction::to_host};
    DelayEdge down_{Direction::to_board};
    std::optional<Past> newer_;
    std::optional<Past> older_;
    std::optional<Asymmetry> asymmetry_;

    BoardTime started_;
    BoardTime slot_begin_;
    BoardTime last_contact_;
    BoardTime window_begin_;
    Duration smallest_in_window_{INT64_MAX};
    Duration smallest_before_{INT64_MAX};
    bool down_in_slot_ = false;
    double slot_share_ = 1;        ///< of what its messages would say if slots were independent
    double recent_surprises_ = 0;  ///< fading
    int contradictions_ = 0;       ///< exchanges in a row
    int unwitnessed_contradictions_ = 0;  ///< of them, the newest in a row
    Persistence persistence_;             ///< of contradicting exchanges
    HostTime last_comparison_;
    bool continued_ = false;  ///< since the newest exchange
    Duration doubt_;          ///< by which exchanges are off
    Duration allowance_;      ///< by which they may be off
    Duration contradiction_;  ///< by which the newest was impossible
    std::uint64_t slots_ = 0;
    std::uint64_t exchanges_ = 0;
    std::uint64_t comparisons_ = 0;
    std::uint64_t one_way_messages_ = 0;
    std::uint64_t restarts_ = 0;
    std::uint64_t surprises_ = 0;
    Duration last_residual_;
    Duration last_innovation_;
    Duration last_round_trip_;
    std::vector<EdgeSite>* sites_ = nullptr;
};

}  // namespace versavis::clock
