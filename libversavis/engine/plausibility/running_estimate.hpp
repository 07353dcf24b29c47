// SPDX-License-Identifier: BSD-3-Clause
// Follows a value that hardly changes from one message to the next, and how far it scatters.
#pragma once

#include <algorithm>
#include <cmath>

#include "engine/rounding.hpp"
#include "versavis/time.hpp"

namespace versavis {

/// Not thread-safe.
class RunningEstimate {
 public:
    /// Until the scatter is known, values within `first_tolerance` of the first are believed.
    explicit RunningEstimate(Duration first_tolerance)
        : deviation_ns_(static_cast<double>(first_tolerance.ns) / deviations) {}

    RunningEstimate(Duration expected, Duration first_tolerance)
        : RunningEstimate(first_tolerance) {
        mean_ns_ = static_cast<double>(expected.ns);
        count_ = 1;
    }

    bool known() const { return count_ > 0; }
    Duration value() const { return rounded(mean_ns_); }

    /// How far off an honest value can be.
    Duration tolerance() const { return floor + rounded(deviations * deviation_ns_); }

    /// Mean deviation of the values, as far as it is known.
    Duration deviation() const { return rounded(deviation_ns_); }

    bool fits(Duration value, Duration allowance = {}) const {
        return !known() || absolute(value - this->value()) <= tolerance() + allowance;
    }

    /// How far off value() can be from what it will be in the mean.
    Duration uncertainty() const { return tolerance() / static_cast<std::int64_t>(count_ + 1); }

    void learn(Duration value) {
        if (!known()) mean_ns_ = static_cast<double>(value.ns);
        const double off = static_cast<double>(value.ns) - mean_ns_;
        count_ = std::min(count_ + 1, mean_memory);
        mean_ns_ += off / count_;
        // What was supposed at first counts as one more value.
        deviation_ns_ += (std::abs(off) - deviation_ns_) / (std::min(count_, memory) + 1);
    }

 private:
    /// Mean deviations that an honest value stays within: 6.4 sigma of a bell.
    static constexpr double deviations = 8;

    /// What is never doubted: the noise of edges and interrupts on a quiet line.
    static constexpr Duration floor = microseconds(10);

    /// Values that the scatter is taken of.
    static constexpr double memory = 16;

    /// The same for the mean, which is what gaps are bridged by.
    static constexpr double mean_memory = 256;

    double mean_ns_ = 0;
    double deviation_ns_;
    double count_ = 0;
};

}  // namespace versavis
