// SPDX-License-Identifier: BSD-3-Clause
// Follows a value that hardly changes from one message to the next, and how far it scatters.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

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

    /// Once it is known, it does not leave what it was then by more than `reach`, and scatters by
    /// no more than twice as much: errors that are believed would make room for larger ones.
    RunningEstimate within(Duration reach) const {
        RunningEstimate bounded = *this;
        bounded.reach_ns_ = static_cast<double>(reach.ns);
        return bounded;
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
        if (reach_ns_) stay_within(*reach_ns_);
    }

 private:
    void stay_within(double reach_ns) {
        if (count_ < values_to_settle) return;
        if (count_ == values_to_settle) {
            settled_ns_ = mean_ns_;
            widest_ns_ = 2 * deviation_ns_ + static_cast<double>(floor.ns) / deviations;
        }
        mean_ns_ = std::clamp(mean_ns_, settled_ns_ - reach_ns, settled_ns_ + reach_ns);
        deviation_ns_ = std::min(deviation_ns_, widest_ns_);
    }

    /// Mean deviations that an honest value stays within: 6.4 sigma of a bell.
    static constexpr double deviations = 8;

    /// What is never doubted: the noise of edges and interrupts on a quiet line.
    static constexpr Duration floor = microseconds(10);

    /// Values that the scatter is taken of.
    static constexpr double memory = 16;

    /// From so many on a bounded one is known: the first tolerance is forgotten then.
    static constexpr double values_to_settle = 128;

    /// The same for the mean, which is what gaps are bridged by.
    static constexpr double mean_memory = 256;

    double mean_ns_ = 0;
    double deviation_ns_;
    double count_ = 0;
    std::optional<double> reach_ns_;  ///< none: it follows wherever the values go
    double settled_ns_ = 0;           ///< once it is known
    double widest_ns_ = 0;            ///< mean deviation, from then on
};

}  // namespace versavis
