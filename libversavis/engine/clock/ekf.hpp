// SPDX-License-Identifier: BSD-3-Clause
// The host clock filter of the original VersaVIS, as a baseline: a Kalman filter on the midpoints
// of exchanges.
#pragma once

#include <cstdint>

#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/messages.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

/// What the filter assumes when it begins. The offset counts from the first midpoint.
struct EkfStart {
    double offset_s = 0.6;
    double skew = -3e-4;
    double offset_variance = 1e-5;  ///< s^2
    double skew_variance = 1e-15;

    /// As shipped. A board that differs much from the one it was tuned on stays outside the gate
    /// for minutes.
    static EkfStart published() { return {}; }
    /// The first midpoint is accepted, and the clocks are assumed to run alike.
    static EkfStart fair() { return {0, 0, 1e-5, 1e-15}; }
};

/// Source: F. Tschopp et al., "VersaVIS: An Open Versatile Multi-Camera Visual-Inertial Sensor
/// Suite", Sensors 2020, 20(5), 1439, and the values of github.com/ethz-asl/rosserial at 9136b35,
/// file node_handle.h, which github.com/ethz-asl/versavis refers to. State: offset and skew;
/// process noise (1e-5, 8e-10) per exchange, whatever time has passed; measurement noise 5e-3,
/// however long the round trip took; an exchange that is 0.5 s or more off the prediction is left
/// out. It stays as it was published, weaknesses included.
class Ekf {
 public:
    explicit Ekf(const EkfStart& start = EkfStart::published()) : start_(start) {}

    void add(const Exchange& exchange);
    void add(const OneWay& /*message*/) {}  ///< the published filter knows exchanges only

    /// `sigma` is what the covariance says: by its measurement noise, some 16 ms at best. `locked`:
    /// the newest exchange was within the gate, and enough were for the gain to be constant.
    HostEstimate translate(BoardTime board) const;

    bool initialised() const { return exchanges_ != 0; }
    std::uint64_t exchanges() const { return exchanges_; }
    std::uint64_t gated() const { return gated_; }  ///< exchanges that were left out
    double skew_ppm() const { return skew_ * 1e6; }
    double skew_sigma_ppm() const;
    double gain() const { return gain_; }  ///< share of the last residual that corrected the offset
    Duration last_residual() const;
    BoardTime last_contact() const { return reference_; }

 private:
    struct Covariance {
        double offset = 0;
        double mixed = 0;
        double skew = 0;
    };

    void start(BoardTime board, HostTime host);
    void predict(double dt);
    void correct();

    EkfStart start_;
    // Host time of board time b is base_host_ + (b - base_board_) + offset_ + skew_ * (b -
    // reference_), in seconds from the first midpoint on: seconds since an epoch would not leave a
    // double the digits.
    BoardTime base_board_;
    HostTime base_host_;
    BoardTime reference_;
    double offset_ = 0;
    double skew_ = 0;
    Covariance covariance_;
    double residual_ = 0;
    double gain_ = 0;
    bool within_gate_ = false;
    std::uint64_t exchanges_ = 0;
    std::uint64_t gated_ = 0;
    std::uint64_t accepted_ = 0;
};

}  // namespace versavis::clock
