// SPDX-License-Identifier: BSD-3-Clause
#include "delivery.hpp"

#include <algorithm>

namespace versavis::daemon {

namespace {

/// What a stream owes is summed up over so long. At half, a loss of less than 6 % never shows; at
/// twice, a stall of 0.3 s counts for 20 s together with the next one.
constexpr Duration memory = seconds(10);

/// What may be owed within the memory: so much time, and so many items of slow streams, which are
/// counted between two of them. At half, a host that pauses for 0.2 s is degraded; at twice, a
/// camera that leaves out every fifth frame is told only after 3 s.
constexpr Duration tolerated_stall = milliseconds(300);
constexpr double tolerated_items = 2.5;

/// After a shortage, full for so long is full again. At half, a stream that loses one frame in
/// twenty flickers; at twice, health lags behind the cure by six seconds.
constexpr Duration recovery = seconds(3);

/// The same after a start. At half, the counts are too few to tell; at twice, a start takes half a
/// second longer to be called good.
constexpr Duration first_proof = milliseconds(500);

/// What may be missing within these two: a share, and what counting between two items hides. At
/// half, a fast stream on a loaded host does not recover; at twice, one that loses every twentieth
/// item does.
constexpr double tolerated_share = 0.03;
constexpr double counted_between = 1.5;

/// The rate that is told is that of so long. At half, it jumps by an item more; at twice, it lags.
constexpr Duration rate_window = seconds(2);

/// No window is shorter than so many periods: fewer items tell nothing. At half, one late frame of
/// a slow camera is a shortage; at twice, a dead slow camera is told so three periods later.
constexpr int least_periods = 3;

double in_seconds(Duration duration) { return static_cast<double>(duration.ns) * 1e-9; }

}  // namespace

void Delivery::begin(HostTime now) {
    if (!delivered_) return;
    counts_.clear();
    report_.fell_short = delivered_ = false;
    report_.full = false;
    report_.began = now;
    report_.rate_hz = 0;
}

Duration Delivery::at_least(Duration window, int periods) const {
    return std::max(window, Duration{static_cast<std::int64_t>(periods * 1e9 / rate_hz_)});
}

/// The newest count that is as old as the window, or the oldest there is.
const Delivery::Count& Delivery::before(Duration window) const {
    const HostTime since = counts_.back().at - window;
    auto found = counts_.begin();
    while (found + 1 != counts_.end() && (found + 1)->at <= since) ++found;
    return *found;
}

bool Delivery::covers(Duration window) const {
    return counts_.back().at - counts_.front().at >= window;
}

/// Items that the rate promised within the window, and that did not come.
double Delivery::missing(Duration window) const {
    const Count& first = before(window);
    const auto got = static_cast<double>(counts_.back().items - first.items);
    return rate_hz_ * in_seconds(counts_.back().at - first.at) - got;
}

void Delivery::count(std::uint64_t items, HostTime now) {
    delivered_ = delivered_ || (!counts_.empty() && items > counts_.back().items);
    counts_.push_back({now, items});
    while (counts_.size() > 2 && counts_[1].at <= now - at_least(memory, least_periods))
        counts_.pop_front();
    const Count& first = before(at_least(rate_window, least_periods));
    if (now > first.at)
        report_.rate_hz = static_cast<double>(items - first.items) / in_seconds(now - first.at);
    if (report_.full) {
        const double owed = std::max(tolerated_items, rate_hz_ * in_seconds(tolerated_stall));
        report_.full = missing(at_least(memory, least_periods)) <= owed;
        report_.fell_short = !report_.full;
        return;
    }
    const Duration window = at_least(report_.fell_short ? recovery : first_proof, least_periods);
    const double share = tolerated_share * rate_hz_ * in_seconds(window);
    report_.full = covers(window) && missing(window) <= std::max(counted_between, share);
    report_.ever = report_.ever || report_.full;
    if (report_.full)  // what was owed before is forgiven
        counts_.erase(counts_.begin(), counts_.end() - 1);
}

}  // namespace versavis::daemon
