// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/ekf.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace versavis::clock {

namespace {

constexpr double offset_noise = 1e-5;
constexpr double skew_noise = 8e-10;
constexpr double measurement_noise = 5e-3;
constexpr double gate_s = 0.5;
constexpr std::uint64_t exchanges_to_lock = 60;  // published: converged after a minute at 1 Hz
constexpr double holdover_after_s = 3;

// Replayed files may hold any stamp: differences of 64-bit stamps need one bit more.
using Wide = __int128;

double to_seconds(Wide ns) { return static_cast<double>(ns) * 1e-9; }

template <class Clock>
Wide between(Time<Clock> begin, Time<Clock> end) {
    return Wide{end.ns} - Wide{begin.ns};
}

std::int64_t clamped(Wide value) {
    constexpr Wide low = std::numeric_limits<std::int64_t>::min();
    constexpr Wide high = std::numeric_limits<std::int64_t>::max();
    return static_cast<std::int64_t>(std::clamp(value, low, high));
}

std::int64_t to_ns(double s) {
    constexpr double most_s = 9e9;
    return std::llround(std::clamp(s, -most_s, most_s) * 1e9);
}

}  // namespace

void Ekf::start(BoardTime board, HostTime host) {
    base_board_ = reference_ = board;
    base_host_ = host;
    offset_ = start_.offset_s;
    skew_ = start_.skew;
    covariance_ = {start_.offset_variance, 0, start_.skew_variance};
}

void Ekf::add(const Exchange& exchange) {
    const BoardTime board{std::midpoint(exchange.received.ns, exchange.answered.ns)};
    const HostTime host{std::midpoint(exchange.sent.ns, exchange.arrived.ns)};
    if (exchanges_++ == 0) return start(board, host);
    predict(to_seconds(between(reference_, board)));
    reference_ = board;
    const double measured = to_seconds(between(base_host_, host) - between(base_board_, board));
    residual_ = measured - offset_;
    within_gate_ = std::abs(residual_) < gate_s;
    if (within_gate_) return correct();
    ++gated_;
}

void Ekf::predict(double dt) {
    offset_ += dt * skew_;
    covariance_.offset += 2 * dt * covariance_.mixed + dt * dt * covariance_.skew + offset_noise;
    covariance_.mixed += dt * covariance_.skew;
    covariance_.skew += skew_noise;
}

void Ekf::correct() {
    ++accepted_;
    const double total = covariance_.offset + measurement_noise;
    gain_ = covariance_.offset / total;
    const double skew_gain = covariance_.mixed / total;
    offset_ += gain_ * residual_;
    skew_ += skew_gain * residual_;
    covariance_.skew -= skew_gain * covariance_.mixed;
    covariance_.mixed *= 1 - gain_;
    covariance_.offset *= 1 - gain_;
}

double Ekf::skew_sigma_ppm() const { return std::sqrt(std::max(covariance_.skew, 0.0)) * 1e6; }

Duration Ekf::last_residual() const { return {to_ns(residual_)}; }

HostEstimate Ekf::translate(BoardTime board) const {
    HostEstimate estimate;
    if (!initialised()) return estimate;
    const double dt = to_seconds(between(reference_, board));
    const double variance =
        covariance_.offset + 2 * dt * covariance_.mixed + dt * dt * covariance_.skew;
    const Wide correction = to_ns(offset_ + skew_ * dt);
    estimate.time = {clamped(Wide{base_host_.ns} + between(base_board_, board) + correction)};
    estimate.sigma = {to_ns(std::sqrt(std::max(variance, 0.0)))};
    const bool settled = within_gate_ && accepted_ >= exchanges_to_lock;
    estimate.state = settled ? ClockState::locked : ClockState::converging;
    if (dt > holdover_after_s) estimate.state = ClockState::holdover;
    return estimate;
}

}  // namespace versavis::clock
