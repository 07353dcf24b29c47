// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/pps_map.hpp"

#include <algorithm>
#include <cmath>

#include "engine/clock/gaussian_state_matrix.hpp"
#include "engine/rounding.hpp"

namespace versavis::clock {

namespace {

// Noise of a pulse: receiver, input and its sampling, in ns. Half: sigma promises more than a
// receiver of 100 ns holds. Twice: stamps follow a pulse more slowly, by half as much.
constexpr double pulse_sigma_ns = 100.0;

// Skew of two crystals before a second pulse has come, in ns/s. Half still covers crystals of
// 50 ppm; twice changes nothing after two pulses.
constexpr double crystal_sigma = 100e3;

// A pulse further off than this, in standard deviations, does not fit. Half: one of 16,000 good
// pulses is left out. Twice: a false one may move the map by twice as much.
constexpr double misfit_sigmas = 8.0;

// Nearer than this, in ns, a pulse fits whatever sigma says. Half: pulses are left out after a
// change of temperature that the model does not expect. Twice: as for misfit_sigmas.
constexpr double smallest_misfit_ns = 2000.0;

// Pulses in a row that do not fit before the map restarts. One: a single false pulse restarts it.
// Six: a receiver that was reset is ignored for six seconds.
constexpr int misfits_to_restart = 3;

// Pulses in a row before the map is used. Two: its skew is that of one interval, off by 0.14 ppm.
// Eight: PPS takes over four seconds later.
constexpr std::uint64_t pulses_to_trust = 4;

// Age of the newest pulse at which PPS counts as gone. Half: one lost pulse ends it. Twice: the
// loss is noticed five seconds late.
constexpr Duration pulse_overdue = milliseconds(2500);

}  // namespace

void PpsMap::begin(BoardTime at, OutputTime second) {
    reference_ = at;
    base_ = {second.ns - at.ns};
    state_ = GaussianState::after_exchange(0);
    matrix(state_)(0, 0) = pulse_sigma_ns * pulse_sigma_ns;
    matrix(state_)(1, 1) = crystal_sigma * crystal_sigma;
    in_row_ = 1;
    misfits_in_row_ = 0;
    last_residual_ = {};
}

bool PpsMap::agrees(double residual_ns, double variance) const {
    return std::abs(residual_ns) <
           std::max(smallest_misfit_ns, misfit_sigmas * std::sqrt(variance));
}

void PpsMap::add(BoardTime at, OutputTime second) {
    ++pulses_;
    if (in_row_ == 0 || at <= reference_ || at - reference_ > longest_holdover)
        return begin(at, second);
    const GaussianState now = state_.after(at - reference_);
    const double residual = static_cast<double>(second.ns - at.ns - base_.ns) - now.mean[0];
    const double variance = matrix(now)(0, 0) + pulse_sigma_ns * pulse_sigma_ns;
    last_residual_ = rounded(residual);
    if (!agrees(residual, variance)) {
        ++rejected_;
        if (++misfits_in_row_ >= misfits_to_restart) begin(at, second);
        return;
    }
    misfits_in_row_ = 0;
    ++in_row_;
    reference_ = at;
    const StateVector gain = matrix(now).col(0) / variance;
    vector(state_) = vector(now) + gain * residual;
    matrix(state_) = matrix(now) - gain * matrix(now).row(0);
}

bool PpsMap::healthy(BoardTime now) const {
    return in_row_ >= pulses_to_trust && misfits_in_row_ == 0 && now - reference_ < pulse_overdue;
}

std::optional<OutputEstimate> PpsMap::translate(BoardTime board) const {
    if (in_row_ < pulses_to_trust || board - reference_ > longest_holdover) return std::nullopt;
    const Duration since = board - reference_;
    return OutputEstimate{OutputTime{board.ns} + base_ + rounded(state_.offset_after(since)),
                          rounded(std::sqrt(state_.offset_variance_after(since)))};
}

}  // namespace versavis::clock
