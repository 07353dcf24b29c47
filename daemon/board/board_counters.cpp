// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_counters.hpp"

namespace versavis::daemon {

namespace {

/// Adds what a counter grew by. One that went back says nothing.
std::uint32_t grow(std::uint32_t& sum, std::uint32_t before, std::uint32_t now) {
    return now > before ? sum += now - before : sum;
}

}  // namespace

wire::Health BoardCounters::since_start(const wire::Health& report) {
    using wire::Health;
    const Health before = last_.value_or(report);
    last_ = report;
    Health counted = report;
    for (const auto counter :
         {&Health::dropped_exposures, &Health::dropped_clock_answers, &Health::dropped_events,
          &Health::dropped_imu_samples, &Health::dropped_logs, &Health::receive_errors,
          &Health::imu_restarts, &Health::late_outputs, &Health::lost_edges, &Health::stray_edges,
          &Health::skipped_triggers, &Health::noisy_inputs, &Health::glitches})
        counted.*counter = grow(sum_.*counter, before.*counter, report.*counter);
    for (std::size_t port = 0; port < wire::imu_count; ++port)
        counted.imu_errors[port] =
            grow(sum_.imu_errors[port], before.imu_errors[port], report.imu_errors[port]);
    return counted;
}

}  // namespace versavis::daemon
