// SPDX-License-Identifier: BSD-3-Clause
#include "pps_monitor.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds second = 1'000'000'000;
constexpr Nanoseconds longest_gap = 10 * second;
constexpr Nanoseconds tolerance_per_second = 200'000;  // 200 ppm: no crystal is off by more
constexpr std::size_t pulses_to_trust = 4;

}  // namespace

void PpsMonitor::pulse(Nanoseconds at) {
    const Nanoseconds gap = count_ == 0 ? 0 : at - pulses_[count_ - 1];
    const Nanoseconds seconds = (gap + second / 2) / second;
    const Nanoseconds off = gap - seconds * second;
    const bool regular = count_ > 0 && gap <= longest_gap && seconds > 0 &&
                         off <= seconds * tolerance_per_second &&
                         -off <= seconds * tolerance_per_second;
    if (!regular) {
        // Noise, or a new phase: start over with it. A source that keeps pulsing is trusted again
        // after a few pulses.
        count_ = 0;
    } else if (count_ == capacity) {
        for (std::size_t i = 1; i < capacity; ++i) {
            pulses_[i - 1] = pulses_[i];
            seconds_[i - 1] = seconds_[i];
        }
        --count_;
    }
    pulses_[count_] = at;
    seconds_[count_] = static_cast<std::uint16_t>(regular ? seconds : 0);
    ++count_;
    Nanoseconds span = 0;
    for (std::size_t i = 1; i < count_; ++i) span += seconds_[i];
    if (span > 0)
        error_ppb_ =
            static_cast<std::int32_t>((pulses_[count_ - 1] - pulses_[0] - span * second) / span);
}

wire::PpsState PpsMonitor::state(Nanoseconds now) const {
    if (count_ == 0 || now - pulses_[count_ - 1] > longest_gap) return wire::PpsState::none;
    return count_ >= pulses_to_trust ? wire::PpsState::good : wire::PpsState::acquiring;
}

}  // namespace versavis::firmware
