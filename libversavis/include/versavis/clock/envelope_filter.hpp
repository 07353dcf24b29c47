// SPDX-License-Identifier: BSD-3-Clause
// Board time to host time from two-way exchanges: a Kalman filter on the envelope of the shortest delays.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>

#include "versavis/time.hpp"

namespace versavis::clock {

/// The four stamps of one exchange: host -> board -> host.
struct Exchange {
    HostTime sent;
    BoardTime received;
    BoardTime answered;
    HostTime arrived;
};

enum class ClockState { init, converging, locked, holdover };
const char* to_string(ClockState state);

struct HostEstimate {
    HostTime time;
    Duration sigma;  ///< one standard deviation
    ClockState state = ClockState::init;
};

/// Method: within a slot that grows from one exchange to 8 s, the smallest delay residual of each direction
/// is kept; their half difference measures the offset error, their sum bounds it (|error| <= sum / 2), and
/// the excess of the sum over its minimum in a window says how much this measurement is worth. No measurement
/// is ever gated out: a surprising one counts less, and four that agree restart the filter. What no stamp can
/// show, the asymmetry of the shortest delays, is part of sigma: its bound, half of their sum, counts as
/// three sigma. A pure function of the exchanges it was given.
class EnvelopeFilter {
 public:
    /// Stamps must not go backwards from exchange to exchange; one whose round trip is negative is ignored.
    void add(const Exchange& exchange);

    /// Host time of `board`, for instants near the newest exchange or later.
    HostEstimate translate(BoardTime board) const;

    bool initialised() const { return exchanges_ != 0; }
    std::uint64_t exchanges() const { return exchanges_; }
    std::uint64_t restarts() const { return restarts_; }
    double skew_ppm() const { return state_[1] * 1e-3; }  ///< host clock against board clock
    double skew_sigma_ppm() const;
    Duration last_residual() const { return last_residual_; }
    Duration last_round_trip() const { return last_round_trip_; }
    Duration smallest_round_trip() const { return {smallest_sum_ns_}; }
    BoardTime last_contact() const { return last_contact_; }

 private:
    struct Slot {
        BoardTime begin;
        std::int64_t up_ns = INT64_MAX;    ///< smallest residual board -> host
        std::int64_t down_ns = INT64_MAX;  ///< smallest residual host -> board
    };
    struct SlotSum {
        BoardTime at;
        std::int64_t sum_ns;
    };

    void start(const Exchange& exchange);
    bool impossible(const Exchange& exchange) const;
    void restart(double offset_change_ns, double offset_sigma_ns);
    std::int64_t predicted_ns(BoardTime board) const;
    void close_slot(BoardTime now);
    void advance(BoardTime to);
    void correct(double innovation_ns, double variance);
    double measurement_variance(std::int64_t sum_ns) const;
    void remember(BoardTime at, std::int64_t sum_ns);
    void restart_if_outliers_agree(double innovation_ns, double deviation);
    double sum_uncertainty() const;
    double unexplained_variance(double explained) const;

    // Host time of board time b is base_host_ + (b - base_board_) + state_[0] + state_[1] * (b - reference_).
    BoardTime base_board_;
    HostTime base_host_;
    BoardTime reference_;
    Eigen::Vector2d state_ = Eigen::Vector2d::Zero();  ///< offset ns, skew ns/s
    Eigen::Matrix2d covariance_ = Eigen::Matrix2d::Zero();

    BoardTime started_;
    BoardTime last_contact_;
    Slot slot_;
    std::deque<SlotSum> sums_;  ///< of the last ten minutes
    std::int64_t smallest_sum_ns_ = 0;
    std::deque<double> innovations_;  ///< of the last slots, absolute
    double outlier_mean_ns_ = 0;
    int outliers_ = 0;
    int impossible_ = 0;
    double trusted_skew_ = 0;  ///< before the first of the outliers
    std::uint64_t slots_ = 0;
    std::uint64_t exchanges_ = 0;
    std::uint64_t restarts_ = 0;
    Duration last_residual_;
    Duration last_round_trip_;
};

}  // namespace versavis::clock
