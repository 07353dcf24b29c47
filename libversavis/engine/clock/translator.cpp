// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/translator.hpp"

#include <algorithm>
#include <cmath>

#include "versavis/metadata.hpp"

namespace versavis::clock {

namespace {

std::uint32_t saturated(Duration sigma) {
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>(sigma.ns, 0, sigma_unknown - 1));
}

// Within an epoch stamps may jump by this when PPS and the messages take turns. Half: links that
// are asymmetric by 0.1 ms begin epochs. Twice: stamps jump by 0.2 ms without saying so.
constexpr Duration largest_jump = microseconds(100);

// Steps of the iteration that turns an output time into a board time; each leaves a thousandth of
// the error. Half suffices for 1 us; twice gains nothing.
constexpr int inversions = 4;

const std::int64_t second_ns = 1'000'000'000;

/// A wide reading of the output clock is part of the stamp's uncertainty: it is off by up to that
/// much, uniformly.
Duration widened(Duration sigma, const OutputReading& output) {
    const auto estimate = static_cast<double>(sigma.ns);
    const auto reading = static_cast<double>(output.uncertainty.ns);
    return {std::llround(std::sqrt(estimate * estimate + reading * reading / 3))};
}

}  // namespace

const char* to_string(AsymmetrySource source) {
    switch (source) {
        case AsymmetrySource::none: return "none";
        case AsymmetrySource::stored: return "stored";
        case AsymmetrySource::pps: return "pps";
    }
    return "unknown";
}

void Translator::board_restarted() {
    const std::lock_guard lock(mutex_);
    ++board_lives_;
    filter_.board_restarted();
    witnesses_.clock_stepped();
    pps_.board_restarted();
    pps_used_ = false;
    newest_ = {};
}

void Translator::begin_epoch() {
    const std::lock_guard lock(mutex_);
    ++jumps_;
}

ClockContact Translator::contact() const {
    const std::lock_guard lock(mutex_);
    return {clock_life(), filter_.comparisons(), filter_.contradicted()};
}

void Translator::clock_continues() {
    const std::lock_guard lock(mutex_);
    filter_.clock_continues();
}

void Translator::add(const Exchange& exchange) {
    const std::lock_guard lock(mutex_);
    const std::uint64_t restarts = filter_.restarts();
    const bool denied = witnesses_.deny(exchange);
    witnesses_.exchanged(exchange, filter_.skew());
    filter_.doubt(witnesses_.doubt(), witnesses_.allowance());
    filter_.add(exchange, denied);
    if (filter_.restarts() != restarts) {
        witnesses_.clock_stepped();
    } else if (witnesses_.show_clock_step()) {
        filter_.clock_stepped();
        witnesses_.clock_stepped();
    }
    filter_.doubt(witnesses_.doubt(), witnesses_.allowance());
}

std::size_t Translator::add_stream(Witness witness) {
    const std::lock_guard lock(mutex_);
    return witnesses_.add_stream(witness);
}

void Translator::heard(std::size_t stream, const OneWay& message, bool fits) {
    const std::lock_guard lock(mutex_);
    witnesses_.heard(stream, {message.sent, {message.arrived.ns - message.sent.ns}}, fits);
}

std::optional<Duration> Translator::departure(std::size_t stream) const {
    const std::lock_guard lock(mutex_);
    return witnesses_.departure(stream);
}

bool Translator::steers(std::size_t stream) const {
    const std::lock_guard lock(mutex_);
    return witnesses_.steers(stream);
}

std::optional<bool> Translator::confirms_others(std::size_t stream) const {
    const std::lock_guard lock(mutex_);
    return witnesses_.confirms_others(stream);
}

void Translator::add(const OneWay& message) {
    const std::lock_guard lock(mutex_);
    filter_.add(message);
}

void Translator::pps_pulse(BoardTime at) {
    const std::lock_guard lock(mutex_);
    HostEstimate estimate = filter_.translate(at);
    estimate.time = estimate.time + filter_.presumed_asymmetry();  // measured, it is not presumed
    if (!filter_.confirmed() || estimate.state != ClockState::locked) return;
    pps_.pulse(at, estimate, output_.read(), output_.kernel_state().synchronised);
    correct_link();
}

std::optional<std::int64_t> Translator::pps_label(BoardTime at, std::int64_t utc_ns) {
    const std::lock_guard lock(mutex_);
    if (!filter_.confirmed()) return std::nullopt;
    const bool tai = output_.kind() == OutputClockKind::tai;
    const Duration ahead = tai ? seconds(output_.kernel_state().tai_offset_s) : Duration{};
    const std::int64_t before = pps_.second_difference();
    pps_.label(at, OutputTime{utc_ns} + ahead, filter_.translate(at), output_.read(),
               output_.kernel_state().synchronised);
    const std::int64_t now = pps_.second_difference();
    return now == before ? std::nullopt : std::optional(now);
}

void Translator::use_asymmetry(const std::optional<Asymmetry>& stored) {
    const std::lock_guard lock(mutex_);
    asymmetry_source_ = stored ? AsymmetrySource::stored : AsymmetrySource::none;
    asymmetry_ = stored.value_or(Asymmetry{});
    filter_.set_asymmetry(stored);
    pps_.link_corrected();
}

void Translator::correct_link() {
    const auto left = pps_.left_in_link();
    if (!left) return;
    asymmetry_ = {asymmetry_.offset + left->offset, left->sigma};
    asymmetry_source_ = AsymmetrySource::pps;
    filter_.set_asymmetry(asymmetry_);
    pps_.link_corrected();
}

std::optional<OutputEstimate> Translator::by_pps(BoardTime board, OutputTime by_link) {
    newest_ = std::max(newest_, board);
    const auto estimate = pps_.translate(board, newest_);
    if (estimate) pps_minus_link_ = estimate->time - by_link;
    if (estimate.has_value() != pps_used_ && absolute(pps_minus_link_) > largest_jump) ++jumps_;
    pps_used_ = estimate.has_value();
    return estimate;
}

std::optional<HostEstimate> Translator::to_host(BoardTime board) const {
    const std::lock_guard lock(mutex_);
    if (!filter_.confirmed()) return std::nullopt;
    return filter_.translate(board);
}

std::optional<Stamp> Translator::translate(BoardTime board) {
    const std::lock_guard lock(mutex_);
    if (!filter_.confirmed()) return std::nullopt;
    const HostEstimate estimate = filter_.translate(board);
    const OutputReading output = output_.read();
    const OutputTime by_link{estimate.time.ns + output.minus_host.ns};
    if (const auto pps = by_pps(board, by_link))
        // The output clock may be off from what PPS makes of it: the host's own time is the link's.
        return Stamp{pps->time,     estimate.time,      saturated(pps->sigma),
                     epoch(output), ClockState::locked, pps_.second_doubted()};
    return Stamp{by_link,       estimate.time,  saturated(widened(estimate.sigma, output)),
                 epoch(output), estimate.state, pps_.second_doubted()};
}

std::optional<BoardSecond> Translator::next_second(HostTime now) {
    const std::lock_guard lock(mutex_);
    if (!filter_.confirmed()) return std::nullopt;
    const OutputReading output = output_.read();
    const Duration offset = output.minus_host;
    BoardSecond second;
    second.output = {((now + offset).ns / second_ns + 1) * second_ns};
    second.host = HostTime{second.output.ns} - offset;
    second.board = filter_.last_contact();
    for (int i = 0; i < inversions; ++i)
        second.board = second.board + (second.host - filter_.translate(second.board).time);
    if (const auto pps = pps_.translate(second.board, newest_))
        second.board = second.board - (pps->time - second.output);
    const HostEstimate estimate = filter_.translate(second.board);
    second.skew_ppm = filter_.skew_ppm();
    second.sigma = estimate.sigma;
    second.epoch = epoch(output);
    second.state = estimate.state;
    return second;
}

Stamp Translator::translate(HostTime host, Duration sigma) {
    const std::lock_guard lock(mutex_);
    const OutputReading output = output_.read();
    return {{host.ns + output.minus_host.ns},
            host,
            saturated(widened(sigma, output)),
            epoch(output),
            ClockState::locked,
            pps_.second_doubted()};
}

OutputRelation Translator::output_now() {
    const std::lock_guard lock(mutex_);
    const OutputReading output = output_.read();
    return {output.at, output.minus_host, output.uncertainty, epoch(output)};
}

ClockReport Translator::report() {
    const std::lock_guard lock(mutex_);
    ClockReport report;
    report.output = output_.kind();
    const OutputReading output = output_.read();
    report.output_minus_host = output.minus_host;
    report.epoch = epoch(output);
    report.output_steps = output.steps;
    report.host_suspends = output_.suspends();
    report.kernel = output_.kernel_state();
    report.state = filter_.translate({}).state;
    report.asymmetry_source = asymmetry_source_;
    report.asymmetry = asymmetry_;
    report.pps = pps_.report(filter_.last_contact());
    if (!filter_.initialised()) return report;
    // The board's time now is unknown here; the newest exchange is at most one interval old.
    const HostEstimate newest = filter_.translate(filter_.last_contact());
    report.since_contact = output.at - newest.time;
    const HostEstimate now = filter_.translate(filter_.last_contact() + report.since_contact);
    report.state = now.state;
    report.sigma = now.sigma;
    report.smallest_round_trip = filter_.smallest_round_trip();
    report.bound = now.bound;
    report.residual = filter_.last_residual();
    report.innovation = filter_.last_innovation();
    report.round_trip = filter_.last_round_trip();
    report.skew_ppm = filter_.skew_ppm();
    report.skew_sigma_ppm = filter_.skew_sigma_ppm();
    report.exchanges = filter_.exchanges();
    report.one_way_messages = filter_.one_way_messages();
    report.slots = filter_.slots();
    report.surprises = filter_.surprises();
    report.restarts = filter_.restarts();
    return report;
}

}  // namespace versavis::clock
