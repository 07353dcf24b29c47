// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/record_gate.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::pairing {

namespace {

// How far the distance of two starts may be off that of their grid points, in periods. Exposures
// begin earlier by half of what they grow. At half a sudden long exposure looks like a step; at
// twice (1.2) a step by one period passes.
constexpr double off_grid = 0.6;

// The same for the rate of a grid that follows another clock. At half a grid that slews may look
// like a step after a pause; at twice a step during a pause of some seconds passes.
constexpr double grid_rate = 2e-3;

// How far off the quickest delay a record is neither late nor early, in periods. At half a busy
// link keeps ids that began anew from being repaired; at twice a step by half a period is not
// noticed.
constexpr double off_delay = 0.25;

// ... but at least so much for an early one. At half a clock estimate that settles looks like a
// step to fast cameras; at twice steps of two periods pass at 1 kHz.
constexpr std::int64_t least_off_delay_ns = 1'000'000;

// Records in a row that took no less until the quickest is believed. At half one delayed record
// makes those after it look early; at twice a step soon after the start may pass.
constexpr int records_to_confirm = 4;

// How fast the quickest is forgotten. At half an old one silences repairs for longer after the
// clock's estimate has moved; at twice a step back is forgotten twice as soon.
constexpr double delay_forgotten = 1e-3;

/// As far apart as they claim to be: lies may differ by more than 64 bits hold.
template <class Time>
double apart_ns(Time from, Time to) {
    return static_cast<double>(to.ns) - static_cast<double>(from.ns);
}

}  // namespace

bool RecordGate::in_order(const Exposure& before, const Exposure& after) const {
    if (after.trigger <= before.trigger || after.tick <= before.tick ||
        after.trigger - before.trigger > after.tick - before.tick)
        return false;
    const auto period = static_cast<double>(period_.ns);
    const double by_grid = static_cast<double>(after.tick - before.tick) * period;
    return std::abs(apart_ns(before.start, after.start) - by_grid) <=
           off_grid * period + grid_rate * by_grid;
}

std::int64_t RecordGate::tolerance_ns() const {
    return std::max(part_of(period_.ns, off_delay), least_off_delay_ns);
}

/// Least time from the end of an exposure until its record comes.
double RecordGate::earliest_ns() const {
    const auto least_ns = static_cast<double>(earliest_.ns);
    if (confirmed_ < records_to_confirm) return least_ns;
    return std::max(least_ns, static_cast<double>(*least_delay_ns_ - tolerance_ns()));
}

bool RecordGate::too_early(const Exposure& exposure) const {
    return exposure.recorded.ns != 0 &&
           apart_ns(exposure.earliest_on_host, exposure.recorded) < earliest_ns();
}

bool RecordGate::live() const {
    return !newest_exposed_ ||
           apart_ns(newest_exposed_->earliest_on_host, late_until_) <= earliest_ns();
}

bool RecordGate::accepts(const Exposure& exposure) const {
    return !too_early(exposure) && (!newest_ || in_order(*newest_, exposure));
}

void RecordGate::take(const Exposure& exposure) {
    newest_ = exposure;
    if (!exposure.exposed) return;
    if (exposure.recorded.ns != 0) learn_delay(exposure);
    newest_exposed_ = exposure;
}

void RecordGate::learn_delay(const Exposure& exposure) {
    const std::int64_t delay_ns = (exposure.recorded - exposure.earliest_on_host).ns;
    const double since_ns = newest_exposed_ ? apart_ns(newest_exposed_->start, exposure.start) : 0;
    const bool first = !least_delay_ns_;
    const std::int64_t least_ns = least_delay_ns_.value_or(delay_ns) +
                                  std::llround(delay_forgotten * std::max(since_ns, 0.0));
    confirmed_ = delay_ns < least_ns - part_of(period_.ns, off_delay) ? 0 : confirmed_ + 1;
    least_delay_ns_ = std::min(least_ns, delay_ns);
    const std::int64_t late_ns = delay_ns - *least_delay_ns_;
    prompt_ = delay_ns <= latest_.ns && late_ns <= part_of(period_.ns, off_delay);
    if (first || delay_ns > latest_.ns || late_ns > tolerance_ns()) late_until_ = exposure.recorded;
}

}  // namespace versavis::pairing
