// SPDX-License-Identifier: BSD-3-Clause
#include "grid.hpp"

namespace versavis::firmware {

namespace {

constexpr std::int64_t ns_uhz = 1'000'000'000'000'000;

/// So that it times a remainder of up to 10^10 stays within 64 bits. If lower, a step is made
/// twice; ten times as much would overflow.
constexpr std::int64_t most_at_once = 400'000'000;

}  // namespace

Grid::Grid(Nanoseconds origin, std::int64_t rate_uhz)
    : next_(origin),
      rate_uhz_(rate_uhz),
      whole_(ns_uhz / rate_uhz),
      remainder_(ns_uhz - whole_ * rate_uhz) {}

void Grid::advance_by(std::int64_t ticks) {
    for (; ticks > most_at_once; ticks -= most_at_once) advance_by(most_at_once);
    const std::int64_t carried = carry_ + ticks * remainder_;
    const std::int64_t whole = carried / rate_uhz_;
    tick_ += static_cast<std::uint64_t>(ticks);
    next_ += ticks * whole_ + whole;
    carry_ = carried - whole * rate_uhz_;
}

void Grid::skip_before(Nanoseconds at) {
    while (at - next_ > whole_) advance_by((at - next_) / (whole_ + 1));
}

}  // namespace versavis::firmware
