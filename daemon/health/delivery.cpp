// SPDX-License-Identifier: BSD-3-Clause
#include "delivery.hpp"

#include <algorithm>

namespace versavis::daemon {

namespace {

/// What a stream owes is summed up over so long.
constexpr Duration memory = seconds(10);

/// What may be owed within the memory: so much time, and so many items of slow streams, which are
/// counted between two of them.
constexpr Duration tolerated_stall = milliseconds(300);
constexpr double tolerated_items = 2.5;

/// After a shortage, full for so long is full again.
constexpr Duration recovery = seconds(3);

/// The same after a start.
constexpr Duration first_proof = milliseconds(500);

/// What may be missing within these two: a share, and what counting between two items hides.
constexpr double tolerated_share = 0.03;
constexpr double counted_between = 1.5;

/// The rate in the status is that of so long.
constexpr Duration rate_window = seconds(2);

/// No window is shorter than so many periods: fewer items show nothing.
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
