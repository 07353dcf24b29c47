// SPDX-License-Identifier: BSD-3-Clause
#include "board/grid_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "board/trigger_grid.hpp"
#include "engine/rounding.hpp"

namespace versavis::daemon {

namespace {

/// Between messages to the board.
constexpr Duration alignment_interval = seconds(1);

/// With a worse clock, nothing is sent to the board.
constexpr Duration largest_grid_sigma = milliseconds(1);

/// Exposures whose median is the grid's error.
constexpr std::size_t errors_kept = 9;

/// What is older says nothing of now.
constexpr Duration memory = seconds(3);

/// An error up to here is called aligned.
constexpr Duration aligned_within = microseconds(100);

}  // namespace

GridAlignment::GridAlignment(const ClockConfiguration& clock, const wire::Configuration& board)
    : wanted_(clock.align),
      max_slew_ppb_(static_cast<std::uint32_t>(std::llround(clock.max_slew_ppm * 1e3))),
      board_(board) {}

void GridAlignment::begin() {
    const std::lock_guard lock(mutex_);
    next_ = {};
    updated_.reset();
    errors_.clear();
}

void GridAlignment::reconfigure(const wire::Configuration& board) {
    const std::lock_guard lock(mutex_);
    board_ = board;
    errors_.clear();
}

std::optional<wire::AlignGrid> GridAlignment::message(HostTime now, clock::Translator& translator) {
    const std::lock_guard lock(mutex_);
    if (!wanted_ || now < next_) return std::nullopt;
    const auto second = translator.next_second(now);
    const bool known = second && second->sigma < largest_grid_sigma &&
                       (second->state == clock::ClockState::locked ||
                        second->state == clock::ClockState::converging);
    if (!known) return std::nullopt;
    const auto pace_ppb = pace_.add(*second);
    if (!pace_ppb) return std::nullopt;
    next_ = now + alignment_interval;
    updated_ = now;
    return wire::AlignGrid{second->board.ns, *pace_ppb, max_slew_ppb_};
}

void GridAlignment::exposure(const wire::Exposure& record, OutputTime middle, HostTime now) {
    const bool own = (record.flags & wire::exposure_measured) != 0 &&
                     (record.flags & wire::exposure_from_master) == 0;
    if (!wanted_ || !own || record.camera >= wire::camera_count) return;
    const std::lock_guard lock(mutex_);
    const wire::CameraConfiguration& camera = board_.cameras[record.camera];
    if (camera.rate_uhz == 0) return;
    const std::int64_t first_tick =
        middle.ns - camera.phase_ns -
        static_cast<std::int64_t>(until_tick(record.tick, camera.rate_uhz));
    errors_.push_back({now, {past_nearest_second_ns(first_tick)}});
    if (errors_.size() > errors_kept) errors_.pop_front();
}

GridReport GridAlignment::report(HostTime now) const {
    const std::lock_guard lock(mutex_);
    GridReport report;
    std::vector<Duration> recent;
    for (const Error& error : errors_)
        if (now - error.at < memory) recent.push_back(error.error);
    if (!recent.empty()) {
        const auto middle = recent.begin() + static_cast<std::ptrdiff_t>(recent.size() / 2);
        std::nth_element(recent.begin(), middle, recent.end());
        report.error = *middle;
    }
    report.aligned =
        updated_ && now - *updated_ < memory && absolute(report.error) < aligned_within;
    return report;
}

}  // namespace versavis::daemon
