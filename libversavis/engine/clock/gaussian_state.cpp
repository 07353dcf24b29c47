// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/gaussian_state_matrix.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::clock {

namespace {

// Skew of two crystals before anything is known, in ns/s: 50 ppm. Half: a crystal of 50 ppm
// surprises. Twice: the first second is less certain.
constexpr double start_skew_sigma = 50e3;

// Random walk of the skew, in ns/s per sqrt(s); crystals have some 10. Half: the estimate lags
// behind. Twice: it is noisier, and holdover claims less.
constexpr double skew_walk = 12.0;

// Random walk of the drift, in ns/s^2 per sqrt(s): 2 ppm in ten minutes are no surprise. Half:
// warming up is followed later. Twice: holdover claims less.
constexpr double drift_walk = 0.15;

// A drift fades within this time: temperature settles. Half or twice shows only after minutes
// without contact.
constexpr double drift_memory_s = 600.0;

// Random walk of the shortest delay, in ns per sqrt(s). Half: a link that changes is followed
// later. Twice: the offset holds the level less firmly.
constexpr double delay_walk = 20.0;

// Shortest delay after one exchange, and its deviation, as a share of the round trip. Half or
// twice: what one exchange says lasts for some slots only.
constexpr double start_delay_of_round_trip = 0.25;

// Deviation of the offset after one exchange, as a share of its round trip: sqrt(1/24), two equal
// uniform delays. Half: sigma is too small at first. Twice: too large.
constexpr double start_sigma_of_round_trip = 0.2041;

double to_seconds(Duration span) { return static_cast<double>(span.ns) * 1e-9; }

}  // namespace

GaussianState GaussianState::after_exchange(double round_trip_ns) {
    GaussianState state;
    state.mean[3] = start_delay_of_round_trip * round_trip_ns;
    const double delay_sigma = state.mean[3];
    const double offset_sigma = start_sigma_of_round_trip * round_trip_ns;
    matrix(state).diagonal() << offset_sigma * offset_sigma, start_skew_sigma * start_skew_sigma,
        drift_walk * drift_walk * drift_memory_s / 2, delay_sigma * delay_sigma;
    return state;
}

StateMatrix transition(Duration span) {
    const double seconds = to_seconds(span);
    StateMatrix result = StateMatrix::Identity();
    result(0, 1) = seconds;
    result(0, 2) = 0.5 * seconds * seconds;
    result(1, 2) = seconds;
    result(2, 2) = std::exp(-seconds / drift_memory_s);
    return result;
}

StateMatrix process_noise(Duration span) {
    const double t = std::abs(to_seconds(span));
    const double t2 = t * t;
    const double skew = skew_walk * skew_walk;
    const double drift = drift_walk * drift_walk;
    StateMatrix noise = StateMatrix::Zero();
    noise(0, 0) = skew * t2 * t / 3 + drift * t2 * t2 * t / 20;
    noise(0, 1) = noise(1, 0) = skew * t2 / 2 + drift * t2 * t2 / 8;
    noise(0, 2) = noise(2, 0) = drift * t2 * t / 6;
    noise(1, 1) = skew * t + drift * t2 * t / 3;
    noise(1, 2) = noise(2, 1) = drift * t2 / 2;
    noise(2, 2) = drift * t;
    noise(3, 3) = delay_walk * delay_walk * t;
    return noise;
}

GaussianState GaussianState::after(Duration span) const {
    const StateMatrix change = transition(span);
    GaussianState later;
    vector(later) = change * vector(*this);
    matrix(later) = change * matrix(*this) * change.transpose() + process_noise(span);
    return later;
}

double GaussianState::offset_after(Duration span) const {
    const double seconds = to_seconds(span);
    return mean[0] + seconds * (mean[1] + 0.5 * seconds * mean[2]);
}

StateVector level_by_component(double sign, Duration span) {
    const double seconds = to_seconds(span);
    return {sign, sign * seconds, sign * 0.5 * seconds * seconds, 1};
}

double GaussianState::offset_variance_after(Duration span) const {
    const double seconds = to_seconds(span);
    const double half_square = 0.5 * seconds * seconds;
    const auto c = matrix(*this);
    const double t = std::abs(seconds);
    const double aged =
        skew_walk * skew_walk * t * t * t / 3 + drift_walk * drift_walk * t * t * t * t * t / 20;
    return std::max(0.0, c(0, 0) + seconds * seconds * c(1, 1) +
                             half_square * half_square * c(2, 2) +
                             2 * (seconds * c(0, 1) + half_square * c(0, 2) +
                                  seconds * half_square * c(1, 2))) +
           aged;
}

}  // namespace versavis::clock
