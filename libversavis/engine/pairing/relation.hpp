// SPDX-License-Identifier: BSD-3-Clause
// Follows the difference between the times of frames and those of their exposures, on one timeline.
#pragma once

#include <cstdint>

namespace versavis::pairing {

/// First-order tracking of difference and drift: an alpha-beta filter with bounded gains.
class Relation {
 public:
    /// `drifts`: the two clocks run at different rates, else the difference is a delay.
    explicit Relation(bool drifts) : drifts_(drifts) {}

    void track(std::int64_t frame_ns, std::int64_t instant_ns);

    /// Another difference from here on: the frames' clock stepped. The rate stays.
    void move(std::int64_t frame_ns, std::int64_t instant_ns);

    bool known() const { return known_; }

    /// The instant of the exposure of a frame of this time.
    std::int64_t expected_instant_ns(std::int64_t frame_ns) const;

    /// How far a frame may lie off where it is expected, by what was seen so far.
    std::int64_t tolerance_ns(std::int64_t instant_ns) const;

    /// Frame time less instant, of the newest pair.
    std::int64_t difference_ns() const { return difference_ns_; }

    /// Mean distance from where frames were expected.
    std::int64_t deviation_ns() const { return deviation_ns_; }

 private:
    void begin(std::int64_t frame_ns, std::int64_t instant_ns);

    bool drifts_;
    bool known_ = false;
    std::int64_t difference_ns_ = 0;  ///< frame time - instant
    std::int64_t begun_ns_ = 0;       ///< instant of the first pair ...
    std::int64_t at_ns_ = 0;          ///< ... and of the newest
    std::int64_t deviation_ns_ = 0;
    double drift_ = 0;
};

}  // namespace versavis::pairing
