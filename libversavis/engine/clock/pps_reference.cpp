// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/pps_reference.hpp"

#include <algorithm>
#include <cmath>

#include "engine/rounding.hpp"

namespace versavis::clock {

namespace {

// Beyond this a pulse could belong to the next second, and is not labelled. Half: a host that is
// off by 60 ms cannot use PPS. Twice: little is left of the half second that decides.
constexpr Duration largest_doubt = milliseconds(100);

// Standard deviations of the estimate that count towards largest_doubt. Half or twice matters only
// while sigma is tens of milliseconds.
constexpr double doubt_sigmas = 3.0;

// After this long without pulses that the host names, messages take over. Half: one lost pulse
// makes the two take turns. Twice: a drift of the PPS map by some 10 ns more.
constexpr Duration host_named_memory = seconds(3);

// Pulses that measure the asymmetry before it is subtracted. Half: it scatters by 1.4 times as
// much. Twice: it is corrected half a minute later.
constexpr unsigned pulses_to_measure = 32;

// Least weight of a new pulse in the mean. Half: a change of the link is followed in two minutes.
// Twice: the mean scatters by 1.4 times as much.
constexpr double slowest_gain = 1.0 / 64;

// What the estimate wanders by too slowly to show as spread between pulses. Half: sigma of the
// corrected estimate is too small. Twice: it is 6 us where 3 us would do.
constexpr Duration measurement_floor = microseconds(3);

// Labels in a row that must agree about the seconds. Half: one label that comes late flags stamps
// for a second. Twice: a wrong second is not flagged for three seconds more.
constexpr int labels_to_agree = 3;

// How far off a whole number of seconds a clock that nobody disciplines may be for that to be no
// accident. Half: the link's asymmetry hides a conflict. Twice: one such host in 25 is flagged.
constexpr Duration whole_seconds = milliseconds(10);

// Seconds between UTC, GPS time and TAI, with room for leap seconds to come: what receivers and
// hosts confuse. Half: TAI is not recognised. Twice: more accidents.
constexpr std::int64_t most_confused_seconds = 40;

/// The whole second nearest to an instant, on the output clock.
OutputTime nearest_second(OutputTime at) { return {at.ns - past_nearest_second_ns(at.ns)}; }

}  // namespace

const char* to_string(PpsState state) {
    switch (state) {
        case PpsState::off: return "off";
        case PpsState::waiting: return "waiting";
        case PpsState::used: return "used";
        case PpsState::lost: return "lost";
    }
    return "unknown";
}

void PpsReference::pulse(BoardTime at, const HostEstimate& by_link, const OutputReading& output,
                         bool disciplined) {
    if (labels_ != PpsLabels::host || !disciplined) return;
    const OutputTime instant{by_link.time.ns + output.minus_host.ns};
    const OutputTime second = nearest_second(instant);
    const Duration residual = instant - second;
    const Duration doubt =
        rounded(doubt_sigmas * static_cast<double>(by_link.sigma.ns)) + absolute(residual);
    if (doubt > largest_doubt) return;
    add(at, second, residual);
    if (map_.healthy(at)) measure(residual);
}

void PpsReference::label(BoardTime at, OutputTime second, const HostEstimate& by_link,
                         const OutputReading& output, bool disciplined) {
    if (labels_ != PpsLabels::nmea) return;
    const OutputTime by_host{by_link.time.ns + output.minus_host.ns};
    if (by_link.state == ClockState::locked) compare(by_host - second, disciplined);
    const bool host_decides = on_conflict_ == SecondConflict::host && disciplined;
    if (host_decides && by_link.state != ClockState::locked) return;  // the nearest may be another
    const OutputTime used = host_decides ? nearest_second(by_host) : second;
    add(at, used, by_host - used);
}

void PpsReference::compare(Duration by_host_less_label, bool disciplined) {
    const std::int64_t past_ns = past_nearest_second_ns(by_host_less_label.ns);
    std::int64_t difference = (past_ns - by_host_less_label.ns) / seconds(1).ns;
    const bool whole = std::abs(past_ns) <= whole_seconds.ns;
    if (!disciplined && (!whole || std::abs(difference) > most_confused_seconds)) difference = 0;
    labels_agree_ = difference == newest_difference_ ? labels_agree_ + 1 : 1;
    newest_difference_ = difference;
    if (labels_agree_ >= labels_to_agree) second_difference_ = difference;
}

void PpsReference::add(BoardTime at, OutputTime second, Duration residual) {
    residual_ = residual;
    map_.add(at, second);
    if (map_.healthy(at)) trusted_at_ = at;
}

void PpsReference::measure(Duration residual) {
    const auto ns = static_cast<double>(residual.ns);
    const double gain = std::max(slowest_gain, 1.0 / ++measured_);
    mean_ns_ += gain * (ns - mean_ns_);
    spread_ns_ += gain * (std::abs(ns - mean_ns_) - spread_ns_);
}

std::optional<Asymmetry> PpsReference::left_in_link() const {
    if (measured_ < pulses_to_measure) return std::nullopt;
    return Asymmetry{{std::llround(mean_ns_)},
                     measurement_floor + Duration{std::llround(spread_ns_)}};
}

void PpsReference::link_corrected() {
    measured_ = 0;
    mean_ns_ = spread_ns_ = 0;
}

std::optional<OutputEstimate> PpsReference::translate(BoardTime board, BoardTime newest) const {
    const Duration memory =
        labels_ == PpsLabels::host ? host_named_memory : PpsMap::longest_holdover;
    if (!trusted_at_ || newest - *trusted_at_ > memory) return std::nullopt;
    return map_.translate(board);
}

void PpsReference::board_restarted() {
    map_ = {};
    trusted_at_.reset();
    second_difference_ = newest_difference_ = 0;
    labels_agree_ = 0;
}

PpsReport PpsReference::report(BoardTime now) const {
    PpsReport report;
    report.residual = residual_;
    report.pulses = map_.pulses();
    report.rejected = map_.rejected();
    report.second_difference = second_difference_;
    if (labels_ == PpsLabels::off)
        report.state = PpsState::off;
    else if (translate(now, now))
        report.state = PpsState::used;
    else
        report.state = trusted_at_ ? PpsState::lost : PpsState::waiting;
    return report;
}

}  // namespace versavis::clock
