// SPDX-License-Identifier: BSD-3-Clause
#include "pps_monitor.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds second = 1'000'000'000;

/// Pulses this far apart are not compared. At half, a receiver that loses its sky for 5 s starts
/// over; at twice, a false pulse is believed for longer.
constexpr Nanoseconds longest_gap = 10 * second;

/// One part in this many (200 ppm): no crystal is off by more. At half, a pulse beside the true one
/// passes more easily; at twice, a bad crystal is never measured.
constexpr Nanoseconds tolerance = 5'000;

/// At half, the slope of a single second is believed; at twice, the state is late.
constexpr std::size_t pulses_to_trust = 4;

}  // namespace

void PpsMonitor::begin(Nanoseconds at) {
    count_ = 0;
    add(at, 0);
}

void PpsMonitor::add(Nanoseconds at, Nanoseconds seconds) {
    if (count_ == capacity) {
        for (std::size_t i = 1; i < capacity; ++i) {
            pulses_[i - 1] = pulses_[i];
            seconds_[i - 1] = seconds_[i];
        }
        --count_;
    }
    pulses_[count_] = at;
    seconds_[count_] = static_cast<std::uint16_t>(seconds);
    ++count_;
    rival_.clear();
}

void PpsMonitor::pulse(Nanoseconds at) {
    const Nanoseconds gap = count_ == 0 ? never : at - pulses_[count_ - 1];
    if (gap > longest_gap) return begin(at);
    const Nanoseconds seconds = (gap + second / 2) / second;
    const Nanoseconds off = gap - seconds * second;
    const Nanoseconds allowed = seconds * (second / tolerance);
    if (seconds == 0 || off > allowed || -off > allowed) {
        // Noise, or a new phase: a source that keeps its pulses there is followed.
        if (rival_.add(at, second, tolerance)) begin(at);
        return;
    }
    add(at, seconds);
    Nanoseconds span = 0;
    for (std::size_t i = 1; i < count_; ++i) span += seconds_[i];
    error_ppb_ = static_cast<std::int32_t>((at - pulses_[0] - span * second) / span);
}

wire::PpsState PpsMonitor::state(Nanoseconds now) const {
    if (count_ == 0 || now - pulses_[count_ - 1] > longest_gap) return wire::PpsState::none;
    return count_ >= pulses_to_trust ? wire::PpsState::good : wire::PpsState::acquiring;
}

}  // namespace versavis::firmware
