// SPDX-License-Identifier: BSD-3-Clause
#include "pps_monitor.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds second = 1'000'000'000;

/// Pulses this far apart are not compared. If lower, a receiver that loses its sky for 5 s starts
/// over; if higher, a false pulse is accepted for longer.
constexpr Nanoseconds longest_gap = 10 * second;

/// One part in this many (200 ppm): no crystal is off by more. If lower, a pulse beside the true
/// one passes more easily; if higher, a bad crystal is never measured.
constexpr Nanoseconds tolerance = 5'000;

/// If lower, the slope of a single second is trusted; if higher, the state is late.
constexpr std::size_t pulses_to_trust = 4;

/// To the nearest. All pulses lie within 64 ms of whole seconds from the oldest.
Nanoseconds whole_seconds(Nanoseconds span) { return (span + second / 2) / second; }

}  // namespace

void PpsMonitor::begin(Nanoseconds at) {
    count_ = 0;
    add(at);
}

void PpsMonitor::add(Nanoseconds at) {
    if (count_ == capacity) {
        --count_;
        for (std::size_t i = 0; i < count_; ++i) pulses_[i] = pulses_[i + 1];
    }
    pulses_[count_++] = at;
    candidate_.clear();
}

void PpsMonitor::pulse(Nanoseconds at) {
    const Nanoseconds gap = count_ == 0 ? never : at - pulses_[count_ - 1];
    if (gap > longest_gap) return begin(at);
    const Nanoseconds seconds = whole_seconds(gap);
    const Nanoseconds off = gap - seconds * second;
    const Nanoseconds allowed = seconds * (second / tolerance);
    if (seconds == 0 || off > allowed || -off > allowed) {
        // Noise, or a new phase: a source that keeps its pulses there is followed.
        if (candidate_.add(at, second, tolerance)) begin(at);
        return;
    }
    add(at);
}

wire::PpsState PpsMonitor::state(Nanoseconds now) const {
    if (count_ == 0 || now - pulses_[count_ - 1] > longest_gap) return wire::PpsState::none;
    return count_ >= pulses_to_trust ? wire::PpsState::good : wire::PpsState::acquiring;
}

std::int32_t PpsMonitor::error_ppb(Nanoseconds now) const {
    if (state(now) != wire::PpsState::good) return 0;
    const Nanoseconds span = pulses_[count_ - 1] - pulses_[0];
    const Nanoseconds seconds = whole_seconds(span);
    return static_cast<std::int32_t>((span - seconds * second) / seconds);
}

}  // namespace versavis::firmware
