// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/record_delay.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::pairing {

namespace {

// How far off the quickest delay a record is neither late nor early, in periods. At half a busy
// link keeps ids that began anew from being repaired; at twice a step by half a period is not
// noticed.
constexpr double off_delay = 0.25;

// ... but at least so much for an early one. At half a clock estimate that settles looks like a
// step to fast cameras; at twice steps of two periods pass at 1 kHz.
constexpr std::int64_t least_off_delay_ns = 1'000'000;

// Records in a row that took no less until the quickest is believed. At half one delayed record
// makes those after it look early; at twice a step soon after the start may pass.
constexpr int delays_to_confirm = 4;

// How fast the quickest is forgotten. At half an old one silences repairs for longer after the
// clock's estimate has moved; at twice a step back is forgotten twice as soon.
constexpr double delay_forgotten = 1e-3;

// Exchanges that agree with the estimate of the board's clock, while records are late, until that
// is the link. At half those that were on the way during a step of the clock may count; at twice
// frames are withheld for another second.
constexpr std::uint64_t exchanges_to_confirm = 10;

/// As far apart as they claim to be: lies may differ by more than 64 bits hold.
template <class Time>
double apart_ns(Time from, Time to) {
    return static_cast<double>(to.ns) - static_cast<double>(from.ns);
}

}  // namespace

std::int64_t RecordDelay::tolerance_ns() const {
    return std::max(part_of(period_.ns, off_delay), least_off_delay_ns);
}

/// Least time from the end of an exposure until its record comes.
double RecordDelay::earliest_ns() const {
    const auto least_ns = static_cast<double>(earliest_.ns);
    if (confirmed_ < delays_to_confirm) return least_ns;
    return std::max(least_ns, static_cast<double>(*least_delay_ns_ - tolerance_ns()));
}

bool RecordDelay::too_early(const Exposure& exposure) const {
    return exposure.recorded.ns != 0 &&
           apart_ns(exposure.earliest_on_host, exposure.recorded) < earliest_ns();
}

bool RecordDelay::live() const {
    return !newest_exposed_ ||
           apart_ns(newest_exposed_->earliest_on_host, late_until_) <= earliest_ns();
}

void RecordDelay::take(const Exposure& exposure) {
    if (!exposure.exposed) return;
    if (exposure.recorded.ns != 0) learn(exposure);
    newest_exposed_ = exposure;
}

void RecordDelay::learn(const Exposure& exposure) {
    const std::int64_t delay_ns = (exposure.recorded - exposure.earliest_on_host).ns;
    const double since_ns = newest_exposed_ ? apart_ns(newest_exposed_->start, exposure.start) : 0;
    const bool first = !least_delay_ns_;
    const std::int64_t least_ns = least_delay_ns_.value_or(delay_ns) +
                                  std::llround(delay_forgotten * std::max(since_ns, 0.0));
    confirmed_ = delay_ns < least_ns - part_of(period_.ns, off_delay) ? 0 : confirmed_ + 1;
    least_delay_ns_ = std::min(least_ns, delay_ns);
    const std::int64_t late_ns = lateness_ns(delay_ns);
    prompt_ = delay_ns <= latest_.ns && late_ns <= part_of(period_.ns, off_delay);
    if (first || delay_ns > latest_.ns || late_ns > tolerance_ns()) late_until_ = exposure.recorded;
    late_ns_ = late_ns;
}

/// Against the usual delay, which a link that became slower moves. What is too early does not
/// follow it: it may be as quick again at any time.
std::int64_t RecordDelay::lateness_ns(std::int64_t delay_ns) {
    if (delay_ns < usual_delay_ns_ - tolerance_ns()) usual_delay_ns_ = quickest;
    const std::int64_t late_ns = delay_ns - std::max(usual_delay_ns_, *least_delay_ns_);
    if (late_ns <= tolerance_ns()) {
        late_run_.reset();
        return late_ns;
    }
    if (!late_run_) late_run_ = {exchanges_.value_or(0), delay_ns};
    late_run_->least_delay_ns = std::min(late_run_->least_delay_ns, delay_ns);
    if (exchanges_.value_or(0) - late_run_->exchanges >= exchanges_to_confirm) {
        usual_delay_ns_ = late_run_->least_delay_ns;
        late_run_.reset();
    }
    return late_ns;
}

void RecordDelay::compared(std::uint64_t exchanges, bool agree) {
    if (!agree || !exchanges_ || exchanges < *exchanges_) late_run_.reset();
    exchanges_ = exchanges;
}

}  // namespace versavis::pairing
