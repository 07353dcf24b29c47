// SPDX-License-Identifier: BSD-3-Clause
#include "board/output_pace.hpp"

#include <cmath>

#include "wire/messages.hpp"

namespace versavis::daemon {

namespace {

/// Readings of the output clock, each good to some ten nanoseconds.
constexpr std::size_t offsets_kept = 8;

}  // namespace

std::optional<std::int32_t> OutputPace::add(const clock::BoardSecond& second) {
    if (epoch_ != second.epoch) offsets_.clear();
    epoch_ = second.epoch;
    offsets_.push_back({second.host, Duration{second.output.ns - second.host.ns}});
    if (offsets_.size() > offsets_kept) offsets_.pop_front();
    const double pace = 1 / ((1 + second.skew_ppm * 1e-6) * (1 + slewed())) - 1;
    const double ppb = std::round(pace * 1e9);
    if (std::abs(ppb) > wire::align_largest_pace_ppb) return std::nullopt;
    return static_cast<std::int32_t>(ppb);
}

/// By which part the output clock ran faster than the host's.
double OutputPace::slewed() const {
    const Duration span = offsets_.back().host - offsets_.front().host;
    const Duration gained = offsets_.back().output_minus_host - offsets_.front().output_minus_host;
    return span.ns == 0 ? 0 : static_cast<double>(gained.ns) / static_cast<double>(span.ns);
}

}  // namespace versavis::daemon
