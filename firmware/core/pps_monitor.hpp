// SPDX-License-Identifier: BSD-3-Clause
// How fast the board's clock runs against pulses that come once a second.
#pragma once

#include "base/hal.hpp"
#include "candidate_pulse_train.hpp"
#include "wire/messages.hpp"

namespace versavis::firmware {

/// Slope over the last pulses, up to 32 s: with edges good to r ns the error is r / 32 ppb.
class PpsMonitor {
 public:
    void pulse(Nanoseconds at);

    /// none: no good pulse within the last seconds before `now`.
    wire::PpsState state(Nanoseconds now) const;
    /// 0 unless the state is good.
    std::int32_t error_ppb(Nanoseconds now) const;

 private:
    static constexpr std::size_t capacity = 33;

    void begin(Nanoseconds at);
    void add(Nanoseconds at);

    std::size_t count_ = 0;
    CandidatePulseTrain candidate_;
    Nanoseconds pulses_[capacity];  ///< oldest first; whole seconds apart
};

}  // namespace versavis::firmware
