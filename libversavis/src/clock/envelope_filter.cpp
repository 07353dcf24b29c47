// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/clock/envelope_filter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace versavis::clock {

namespace {

constexpr double start_skew_sigma = 100e3;     // ns/s: two crystals of 50 ppm
constexpr double skew_walk = 50.0;             // ns/s per sqrt(s)
constexpr double asymmetry_floor_ns = 1000.0;  // what even the shortest delays vary by
constexpr std::int64_t longest_slot_ns = 8'000'000'000;
constexpr std::int64_t slots_per_age = 16;
constexpr std::int64_t window_ns = 600'000'000'000;
constexpr std::int64_t early_ns = 5'000'000'000;
constexpr std::uint64_t early_slots = 10;
constexpr std::size_t innovations_kept = 31;
constexpr double outlier_sigmas = 3.0;
constexpr int outliers_to_restart = 4;
constexpr std::int64_t gap_ns = 2'000'000'000;
constexpr double impossible_sigmas = 4.0;
constexpr int impossible_to_restart = 3;
constexpr double locked_sigma_ns = 100e3;
constexpr std::int64_t holdover_after_ns = 3'000'000'000;

double to_seconds(Duration d) { return static_cast<double>(d.ns) * 1e-9; }

}  // namespace

const char* to_string(ClockState state) {
    switch (state) {
        case ClockState::init: return "init";
        case ClockState::converging: return "converging";
        case ClockState::locked: return "locked";
        case ClockState::holdover: return "holdover";
    }
    return "unknown";
}

void EnvelopeFilter::start(const Exchange& exchange) {
    base_board_ = middle(exchange.received, exchange.answered);
    base_host_ = middle(exchange.sent, exchange.arrived);
    reference_ = started_ = base_board_;
    const auto round_trip = static_cast<double>(last_round_trip_.ns);
    covariance_ << round_trip * round_trip / 12, 0, 0, start_skew_sigma * start_skew_sigma;
    slot_ = {exchange.answered};
    remember(base_board_, last_round_trip_.ns);
    ++slots_;
}

void EnvelopeFilter::add(const Exchange& exchange) {
    const Duration round_trip = (exchange.arrived - exchange.sent) - (exchange.answered - exchange.received);
    if (round_trip.ns <= 0) return;
    last_round_trip_ = round_trip;
    const bool gap = (exchange.answered - last_contact_).ns > gap_ns;
    last_contact_ = exchange.answered;
    if (exchanges_++ == 0) return start(exchange);
    if (gap) slot_ = {exchange.answered};  // minima from both sides of a gap do not belong together
    if (impossible(exchange)) {
        slot_ = {exchange.answered};
        if (++impossible_ < impossible_to_restart) return;
        const double error = static_cast<double>(middle(exchange.sent, exchange.arrived).ns -
                                                 predicted_ns(middle(exchange.received, exchange.answered)));
        if (outliers_ == 0) trusted_skew_ = state_[1];
        advance(exchange.answered);
        return restart(error, static_cast<double>(round_trip.ns) / 2);
    }
    impossible_ = 0;
    slot_.down_ns = std::min(slot_.down_ns, predicted_ns(exchange.received) - exchange.sent.ns);
    slot_.up_ns = std::min(slot_.up_ns, exchange.arrived.ns - predicted_ns(exchange.answered));
    const std::int64_t slot_length =
        std::min((exchange.answered - started_).ns / slots_per_age, longest_slot_ns);
    if ((exchange.answered - slot_.begin).ns >= slot_length) close_slot(exchange.answered);
}

/// True when an instant would have been seen before it happened, by more than the estimate's own error
/// explains.
bool EnvelopeFilter::impossible(const Exchange& exchange) const {
    const auto up = static_cast<double>(exchange.arrived.ns - predicted_ns(exchange.answered));
    const auto down = static_cast<double>(predicted_ns(exchange.received) - exchange.sent.ns);
    const double dt = to_seconds(exchange.answered - reference_);
    const double variance = covariance_(0, 0) + 2 * dt * covariance_(0, 1) + dt * dt * covariance_(1, 1) +
                            skew_walk * skew_walk * std::abs(dt * dt * dt) / 3;
    return std::min(up, down) < -impossible_sigmas * std::sqrt(std::max(variance, 0.0));
}

std::int64_t EnvelopeFilter::predicted_ns(BoardTime board) const {
    const double correction = state_[0] + state_[1] * to_seconds(board - reference_);
    return base_host_.ns + (board - base_board_).ns + std::llround(correction);
}

void EnvelopeFilter::close_slot(BoardTime now) {
    const std::int64_t sum = slot_.up_ns + slot_.down_ns;
    const double innovation = (static_cast<double>(slot_.up_ns) - static_cast<double>(slot_.down_ns)) / 2;
    slot_ = {now};
    if (sum <= 0) return;  // minima from both sides of a step
    ++slots_;
    remember(now, sum);
    advance(now);
    correct(innovation, measurement_variance(sum));
}

void EnvelopeFilter::advance(BoardTime to) {
    const double dt = to_seconds(to - reference_);
    reference_ = to;
    Eigen::Matrix2d transition;
    transition << 1, dt, 0, 1;
    const double q = skew_walk * skew_walk;
    Eigen::Matrix2d noise;
    noise << q * dt * dt * dt / 3, q * dt * dt / 2, q * dt * dt / 2, q * dt;
    state_ = transition * state_;
    covariance_ = transition * covariance_ * transition.transpose() + noise;
}

double EnvelopeFilter::measurement_variance(std::int64_t sum_ns) const {
    const auto sum = static_cast<double>(sum_ns);
    const bool early = slots_ <= early_slots || (reference_ - started_).ns < early_ns;
    if (early) return sum * sum / 12;
    const double bound = sum - static_cast<double>(smallest_sum_ns_) + sum_uncertainty();
    return asymmetry_floor_ns * asymmetry_floor_ns + bound * bound / 12;
}

void EnvelopeFilter::correct(double innovation_ns, double variance) {
    last_residual_ = {std::llround(innovation_ns)};
    variance += unexplained_variance(covariance_(0, 0) + variance);
    innovations_.push_back(innovation_ns);
    if (innovations_.size() > innovations_kept) innovations_.pop_front();

    double total = covariance_(0, 0) + variance;
    const double deviation = std::abs(innovation_ns) / std::sqrt(total);
    if (deviation > outlier_sigmas && outliers_ == 0) trusted_skew_ = state_[1];
    if (deviation > outlier_sigmas) total *= deviation / outlier_sigmas;  // Huber: influence grows no further
    const Eigen::Vector2d gain = covariance_.col(0) / total;
    state_ += gain * innovation_ns;
    covariance_ -= gain * covariance_.row(0);
    covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
    restart_if_outliers_agree(innovation_ns, deviation);
}

void EnvelopeFilter::restart_if_outliers_agree(double innovation_ns, double deviation) {
    const bool agrees = outliers_ == 0 || innovation_ns * outlier_mean_ns_ > 0;
    outliers_ = deviation > outlier_sigmas ? (agrees ? outliers_ + 1 : 1) : 0;
    outlier_mean_ns_ = innovation_ns;
    if (outliers_ == outliers_to_restart) restart(innovation_ns, std::abs(innovation_ns));
}

/// Begins anew near the newest measurement; the skew is a guess from before.
void EnvelopeFilter::restart(double offset_change_ns, double offset_sigma_ns) {
    ++restarts_;
    outliers_ = impossible_ = 0;
    sums_.clear();
    innovations_.clear();
    slots_ = 0;
    started_ = reference_;
    slot_ = {reference_};
    remember(reference_, std::llround(2 * offset_sigma_ns));
    state_[0] += offset_change_ns;
    state_[1] = trusted_skew_;
    covariance_ << offset_sigma_ns * offset_sigma_ns, 0, 0, start_skew_sigma * start_skew_sigma;
}

void EnvelopeFilter::remember(BoardTime at, std::int64_t sum_ns) {
    sums_.push_back({at, sum_ns});
    while ((at - sums_.front().at).ns > window_ns) sums_.pop_front();
    const auto smaller = [](const SlotSum& a, const SlotSum& b) { return a.sum_ns < b.sum_ns; };
    smallest_sum_ns_ = std::min_element(sums_.begin(), sums_.end(), smaller)->sum_ns;
}

double EnvelopeFilter::sum_uncertainty() const {
    std::vector<std::int64_t> lowest;
    for (const SlotSum& slot : sums_) lowest.push_back(slot.sum_ns);
    const std::size_t count = std::min<std::size_t>(lowest.size(), 3);
    std::partial_sort(lowest.begin(), lowest.begin() + static_cast<std::ptrdiff_t>(count), lowest.end());
    lowest.resize(count);
    return lowest.empty() ? 0 : static_cast<double>(lowest.back() - lowest.front());
}

double EnvelopeFilter::unexplained_variance(double explained) const {
    if (innovations_.size() < early_slots) return 0;
    std::vector<double> sorted(innovations_.begin(), innovations_.end());
    const auto middle_at = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle_at, sorted.end());
    const double bias = *middle_at;  // a common part is not noise: it must be followed
    for (double& innovation : sorted) innovation = std::abs(innovation - bias);
    std::nth_element(sorted.begin(), middle_at, sorted.end());
    const double sigma = 1.4826 * *middle_at;
    return std::max(0.0, sigma * sigma - explained);
}

double EnvelopeFilter::skew_sigma_ppm() const { return std::sqrt(covariance_(1, 1)) * 1e-3; }

HostEstimate EnvelopeFilter::translate(BoardTime board) const {
    HostEstimate estimate;
    if (!initialised()) return estimate;
    const double dt = to_seconds(board - reference_);
    const double estimated = covariance_(0, 0) + 2 * dt * covariance_(0, 1) + dt * dt * covariance_(1, 1) +
                             skew_walk * skew_walk * std::abs(dt * dt * dt) / 3;
    const double asymmetry = static_cast<double>(smallest_sum_ns_) / 6;
    estimate.time = {predicted_ns(board)};
    estimate.sigma = {std::llround(std::sqrt(std::max(estimated, 1.0) + asymmetry * asymmetry))};
    // A slow link's asymmetry stays, however long one waits: it is no lack of convergence.
    const bool uncertain = slots_ < early_slots || std::sqrt(std::max(estimated, 0.0)) > locked_sigma_ns;
    estimate.state = uncertain ? ClockState::converging : ClockState::locked;
    if ((board - last_contact_).ns > holdover_after_ns) estimate.state = ClockState::holdover;
    return estimate;
}

}  // namespace versavis::clock
