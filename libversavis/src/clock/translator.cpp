// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/clock/translator.hpp"

#include <algorithm>

#include "versavis/metadata.hpp"

namespace versavis::clock {

namespace {

std::uint32_t saturated(Duration sigma) {
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>(sigma.ns, 0, sigma_unknown - 1));
}

}  // namespace

void Translator::board_restarted() {
    const std::lock_guard lock(mutex_);
    board_lives_ += 1 + static_cast<std::uint32_t>(filter_.restarts());
    filter_ = EnvelopeFilter();
}

void Translator::add(const Exchange& exchange) {
    const std::lock_guard lock(mutex_);
    filter_.add(exchange);
}

std::optional<HostEstimate> Translator::to_host(BoardTime board) const {
    const std::lock_guard lock(mutex_);
    if (!filter_.initialised()) return std::nullopt;
    return filter_.translate(board);
}

std::optional<Stamp> Translator::translate(BoardTime board) {
    const std::lock_guard lock(mutex_);
    if (!filter_.initialised()) return std::nullopt;
    const HostEstimate estimate = filter_.translate(board);
    const OutputTime output{estimate.time.ns + output_.offset().ns};
    return Stamp{output, estimate.time, saturated(estimate.sigma), epoch(), estimate.state};
}

Stamp Translator::translate(HostTime host, Duration sigma) {
    const std::lock_guard lock(mutex_);
    const OutputTime output{host.ns + output_.offset().ns};
    return {output, host, saturated(sigma), epoch(), ClockState::locked};
}

ClockReport Translator::report() {
    const std::lock_guard lock(mutex_);
    ClockReport report;
    report.output = output_.kind();
    report.output_minus_host = output_.offset();
    report.epoch = epoch();
    report.output_steps = output_.steps();
    if (!filter_.initialised()) return report;
    // The board's time now is unknown here; the newest exchange is at most one interval old.
    const HostEstimate newest = filter_.translate(filter_.last_contact());
    const Duration since_contact = host_now() - newest.time;
    const HostEstimate now = filter_.translate(filter_.last_contact() + since_contact);
    report.state = now.state;
    report.sigma = now.sigma;
    report.smallest_round_trip = filter_.smallest_round_trip();
    report.bound = report.smallest_round_trip / 2;
    report.residual = filter_.last_residual();
    report.round_trip = filter_.last_round_trip();
    report.skew_ppm = filter_.skew_ppm();
    report.skew_sigma_ppm = filter_.skew_sigma_ppm();
    report.exchanges = filter_.exchanges();
    report.restarts = filter_.restarts();
    return report;
}

}  // namespace versavis::clock
