// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/record_filter.hpp"

#include <algorithm>
#include <utility>

namespace versavis::pairing {

namespace {

/// What a board needs to notice that an exposure has lasted too long.
constexpr Duration overlong_slack = milliseconds(2);

/// The board waits for a start so long, or for a period.
constexpr Duration shortest_patience = milliseconds(2);

/// Exposures that differ by less are of equal length: triggers then say how fast the grid runs.
constexpr Duration equal_exposures = microseconds(40);

/// The grid runs at the board's pace within one part in so many: aligned, it follows another clock.
constexpr std::int64_t first_pace_parts = 500;

/// Over lost records the pace may wander by one part in so many.
constexpr std::int64_t wander_parts = 10'000;

/// A trigger that leaves late says so, and is sent no later than this.
constexpr Duration latest_trigger = milliseconds(2);

/// How far a trigger may be off its grid point, on a fixed grid.
constexpr Duration grid_tolerance = microseconds(10);

/// The period is rounded to 1 ns.
constexpr Duration grid_rounding = nanoseconds(1);

/// How far a camera's latency, or an exposure that it keeps to, may wander while it runs: lines
/// that warm up, and the crystals of camera and board.
constexpr Duration latency_reach = microseconds(20);

/// An exposure that was announced and the one that the line shows may differ by the line's delays.
constexpr Duration announced_difference = microseconds(500);

/// By which factor an exposure whose record is missing may differ from those around it.
constexpr std::int64_t unseen_change = 2;

/// How far the second latency, or the second exposure of equal length, may be off from the first.
constexpr Duration first_tolerance = milliseconds(1);

/// Majority of records that agree, after nothing was known, until those that do not are doubted
/// rather than they themselves.
constexpr int records_to_confirm = 3;

/// 73 years: a grid point beyond it is a lie.
constexpr double furthest_grid_ns = 2.3e18;

bool has_start(const wire::Exposure& record) { return record.start_ns != wire::no_time; }
bool has_end(const wire::Exposure& record) { return record.end_ns != wire::no_time; }
bool has(const wire::Exposure& record, unsigned flags) { return (record.flags & flags) != 0; }

/// Flags and times must agree.
bool flags_agree(const wire::Exposure& record, const RecordLimits& limits) {
    constexpr unsigned outcomes = wire::exposure_measured | wire::exposure_no_start |
                                  wire::exposure_no_end | wire::exposure_predicted;
    const bool by_master = !limits.wired && limits.slave;
    if (has(record, wire::exposure_from_master) != by_master) return false;
    switch (record.flags & outcomes) {
        case wire::exposure_measured:
            return has_start(record) && has_end(record) && (limits.wired || by_master);
        case wire::exposure_predicted: return has_start(record) && has_end(record) && !limits.wired;
        case wire::exposure_no_start: return !has_start(record) && !has_end(record);
        case wire::exposure_no_end: return has_start(record) && !has_end(record);
        default: return false;
    }
}

}  // namespace

BoardTime newest_instant(const wire::Exposure& record) {
    return {std::max({record.trigger_ns, record.start_ns, record.end_ns})};
}

std::optional<Implausibility> contradicts_itself(const wire::Exposure& record,
                                                 const RecordLimits& limits) {
    if (!flags_agree(record, limits))
        return Implausibility{EventReason::implausible_flags, record.flags, 0};
    if (!has_start(record)) return std::nullopt;
    const Duration latest = limits.latency + limits.period + shortest_patience + overlong_slack;
    if (record.start_ns < record.trigger_ns || record.start_ns - record.trigger_ns > latest.ns)
        return Implausibility{EventReason::implausible_time, record.start_ns, record.trigger_ns};
    if (!has_end(record)) return std::nullopt;
    const Duration longest = limits.max_exposure + overlong_slack;
    if (record.end_ns < record.start_ns || record.end_ns - record.start_ns > longest.ns)
        return Implausibility{EventReason::implausible_length, record.end_ns,
                              record.start_ns + longest.ns};
    return std::nullopt;
}

RecordHistory::RecordHistory(const RecordLimits& limits)
    : period_(limits.period),
      slave_(limits.slave),
      fixed_grid_(limits.fixed_grid && !limits.slave),
      slew_(rounded(static_cast<double>(period_.ns) * limits.grid_slew_ppm * 1e-6)),
      pace_(period_, period_ / first_pace_parts),
      latency_(RunningEstimate(first_tolerance).within(latency_reach)),
      length_(RunningEstimate(first_tolerance).within(latency_reach)) {
    lengths_[length_count_++] = limits.exposure;
}

std::optional<Implausibility> RecordHistory::doubt(const ReceivedRecord& received) const {
    const wire::Exposure& record = received.record;
    if (newest_)
        if (auto doubt = number_doubt(record)) return doubt;
    if (auto doubt = trigger_doubt(record)) return doubt;
    if (auto doubt = start_doubt(record)) return doubt;
    return end_doubt(received);
}

/// Each trigger has a grid point of its own, in order, and each grid point a trigger, but for those
/// that the board leaves out.
std::optional<Implausibility> RecordHistory::number_doubt(const wire::Exposure& record) const {
    const std::uint64_t ticks = record.tick - newest_->tick;
    const std::uint64_t triggers = record.trigger - newest_->trigger;
    const bool counted = record.trigger > newest_->trigger;
    if (!grid_known_ && counted) return std::nullopt;
    if (counted && record.tick > newest_->tick && triggers <= ticks &&
        may_skip(record, ticks - triggers))
        return std::nullopt;
    return Implausibility{EventReason::implausible_number,
                          static_cast<std::int64_t>(record.trigger),
                          static_cast<std::int64_t>(newest_->trigger + 1)};
}

bool RecordHistory::may_skip(const wire::Exposure& record, std::uint64_t points) const {
    constexpr unsigned sparse = wire::exposure_pattern | wire::exposure_slow;
    return points <= skips_ || slave_ || has(record, sparse) || has(*newest_, sparse);
}

bool RecordHistory::only_skips(const wire::Exposure& record) const {
    return newest_ && record.tick > newest_->tick && record.trigger > newest_->trigger &&
           record.trigger - newest_->trigger <= record.tick - newest_->tick &&
           !trigger_doubt(record);
}

std::optional<Implausibility> RecordHistory::trigger_doubt(const wire::Exposure& record) const {
    if (grid_)
        if (auto doubt = grid_doubt(record)) return doubt;
    return newest_ && grid_known_ ? pace_doubt(record) : std::nullopt;
}

std::optional<Implausibility> RecordHistory::grid_doubt(const wire::Exposure& record) const {
    // An exposure that no record names may have been expected of the first triggers alone: after a
    // gap, one record too many is doubted rather than one too few.
    const GridPoint said = by_trigger(record, length_count_ > remembered_lengths);
    const auto grid = predicted(record.tick);
    Implausibility doubt{EventReason::implausible_time, record.trigger_ns, record.trigger_ns};
    if (!grid) return doubt;
    const Duration late = has(record, wire::exposure_late) ? latest_trigger : Duration{};
    const Duration early_by = grid->earliest - grid_tolerance - said.latest;
    const Duration late_by = said.earliest - late - (grid->latest + grid_tolerance);
    if (early_by.ns <= 0 && late_by.ns <= 0) return std::nullopt;
    doubt.expected += early_by.ns > 0 ? early_by.ns : -late_by.ns;
    return doubt;
}

/// A fixed grid is where it always was, to the rounding of the period.
/// None: ticks that far apart cannot be.
std::optional<RecordHistory::GridPoint> RecordHistory::predicted(std::uint64_t tick) const {
    const auto ticks = static_cast<std::int64_t>(tick - grid_->tick);
    if (std::abs(static_cast<double>(ticks)) * static_cast<double>(period_.ns) > furthest_grid_ns)
        return std::nullopt;
    const Duration moved = period_ * ticks;
    const Duration rounding = grid_rounding * std::abs(ticks);
    return GridPoint{tick, grid_->earliest + moved - rounding, grid_->latest + moved + rounding};
}

bool RecordHistory::all_seen(const wire::Exposure& record) const {
    return length_count_ > remembered_lengths &&
           (record.trigger == seen_ + 1 || commanded_.ns != 0);
}

/// The board sends a trigger half the exposure that it expects before the grid point.
RecordHistory::GridPoint RecordHistory::by_trigger(const wire::Exposure& record,
                                                   bool exposures_known) const {
    Lengths expected = lengths(record);
    if (!exposures_known)
        expected = {expected.shortest / unseen_change, expected.longest * unseen_change};
    if (has(record, wire::exposure_announced)) {
        expected.shortest = expected.shortest - announced_difference;
        expected.longest = expected.longest + announced_difference;
    }
    const BoardTime trigger{record.trigger_ns};
    return {record.tick, trigger + expected.shortest / 2, trigger + expected.longest / 2};
}

std::optional<bool> RecordHistory::on_grid(const ReceivedRecord& received) const {
    const wire::Exposure& record = received.record;
    if (!fixed_grid_ || received.grid_ns == 0 || !trigger_doubt(record)) return std::nullopt;
    const auto kept = grid_ ? predicted(record.tick) : std::nullopt;
    if (!kept) return std::nullopt;
    const auto is_at = [&](const GridPoint& point, Duration late) {
        const BoardTime named{received.grid_ns};
        return point.earliest - late - grid_tolerance <= named &&
               named <= point.latest + grid_tolerance;
    };
    const Duration late = has(record, wire::exposure_late) ? latest_trigger : Duration{};
    const bool said = is_at(by_trigger(record, all_seen(record)), late);
    // What both fit, or neither, does not tell them apart.
    if (said == is_at(*kept, {})) return std::nullopt;
    return said;
}

/// What is known gets narrower, and never moves.
void RecordHistory::learn_grid(const wire::Exposure& record) {
    if (!fixed_grid_ || has(record, wire::exposure_late)) return;
    const GridPoint said = by_trigger(record, all_seen(record));
    const auto grid = grid_ ? predicted(record.tick) : std::nullopt;
    grid_ = said;
    if (!grid) return;
    grid_->earliest = std::clamp(said.earliest, grid->earliest, grid->latest);
    grid_->latest = std::clamp(said.latest, grid->earliest, grid->latest);
}

std::optional<Implausibility> RecordHistory::pace_doubt(const wire::Exposure& record) const {
    const Duration since{record.trigger_ns - punctual_->trigger_ns};
    const std::uint64_t ticks = record.tick - punctual_->tick;
    const Implausibility doubt{EventReason::implausible_time, record.trigger_ns,
                               punctual_->trigger_ns + pace_.value().ns};
    // As real numbers: ticks may be a lie.
    const double expected_ns = static_cast<double>(ticks) * static_cast<double>(pace_.value().ns);
    if (expected_ns > furthest_grid_ns) return doubt;
    const Duration off = since - Duration{static_cast<std::int64_t>(expected_ns)};
    Duration tolerance = pace_.tolerance() + compensation(record);
    const std::int64_t skipped = rounded(expected_ns).ns / pace_.value().ns - 1;
    tolerance = tolerance + slew_ * (skipped + 1) +
                (pace_.value() / wander_parts + pace_.uncertainty()) * skipped;
    if (has(record, wire::exposure_late) || has(*punctual_, wire::exposure_late))
        tolerance = tolerance + latest_trigger;
    if (absolute(off) <= tolerance) return std::nullopt;
    return Implausibility{doubt.reason, doubt.said, (Duration{record.trigger_ns} - off).ns};
}

/// Exposures among which the one may be that the board expected when it placed the trigger.
RecordHistory::Lengths RecordHistory::lengths(const wire::Exposure& record) const {
    const std::size_t known = std::min(length_count_, remembered_lengths);
    auto [shortest, longest] = std::minmax_element(lengths_, lengths_ + known);
    Lengths range{*shortest, *longest};
    if (!has_start(record) || !has_end(record)) return range;
    const Duration own{record.end_ns - record.start_ns};
    return {std::min(range.shortest, own), std::max(range.longest, own)};
}

/// By how much two triggers may lie closer or further apart, because other exposures were expected
/// of them.
Duration RecordHistory::compensation(const wire::Exposure& record) const {
    const Lengths expected = lengths(record);
    return (expected.longest - expected.shortest) / 2;
}

std::optional<Implausibility> RecordHistory::start_doubt(const wire::Exposure& record) const {
    if (!has_start(record)) return std::nullopt;
    if (latency_.fits({record.start_ns - record.trigger_ns})) return std::nullopt;
    return Implausibility{EventReason::implausible_time, record.start_ns,
                          record.trigger_ns + latency_.value().ns};
}

std::optional<Implausibility> RecordHistory::end_doubt(const ReceivedRecord& received) const {
    const wire::Exposure& record = received.record;
    if (!has_start(record) || !has_end(record)) return std::nullopt;
    if (received.commanded.ns == 0 || received.commanded != commanded_) return std::nullopt;
    if (length_.fits({record.end_ns - record.start_ns})) return std::nullopt;
    return Implausibility{EventReason::implausible_length, record.end_ns,
                          record.start_ns + length_.value().ns};
}

void RecordHistory::learn(const ReceivedRecord& received) {
    const wire::Exposure& record = received.record;
    learn_grid(record);
    if (grid_known_ && !has(record, wire::exposure_late) && !has(*punctual_, wire::exposure_late) &&
        compensation(record) * 2 < equal_exposures) {
        const auto ticks = static_cast<std::int64_t>(record.tick - punctual_->tick);
        pace_.learn({(record.trigger_ns - punctual_->trigger_ns) / ticks});
    }
    see(record);
    if (!grid_known_ || !has(record, wire::exposure_late)) punctual_ = record;
    newest_ = record;
    grid_known_ = true;
    skips_ = 0;
    if (!has_start(record)) return;
    latency_.learn({record.start_ns - record.trigger_ns});
    if (!has_end(record)) return;
    if (received.commanded != commanded_)
        length_ = RunningEstimate(first_tolerance).within(latency_reach);
    commanded_ = received.commanded;
    length_.learn({record.end_ns - record.start_ns});
}

void RecordHistory::see(const wire::Exposure& record) {
    seen_ = record.trigger;
    if (has_start(record) && has_end(record))
        lengths_[length_count_++ % remembered_lengths] = {record.end_ns - record.start_ns};
}

bool RecordHistory::repeats(const ReceivedRecord& received) const {
    return of_newest_trigger(received.record) && !disputes_newest(received.record);
}

bool RecordHistory::disputes_newest(const wire::Exposure& record) const {
    return of_newest_trigger(record) &&
           (newest_->start_ns != record.start_ns || newest_->end_ns != record.end_ns ||
            newest_->trigger_ns != record.trigger_ns);
}

RecordFilter::RecordFilter(const RecordLimits& limits)
    : limits_(limits), filter_(RecordHistory(limits), records_to_confirm) {}

void RecordFilter::set_limits(const RecordLimits& limits) {
    if (!(limits == limits_)) *this = RecordFilter(limits);
}

RecordVerdict RecordFilter::judge(const ReceivedRecord& received) {
    verdict_ = {};
    verdict_.doubt = contradicts_itself(received.record, limits_);
    if (verdict_.doubt) return verdict_;
    std::optional<Implausibility> arrival;
    if (received.arrival != EventReason::none)
        arrival = {received.arrival, newest_instant(received.record).ns, received.expected_ns};
    verdict_.doubt = filter_.judge(received, received.exchanges, arrival);
    verdict_.overturned = filter_.overturned();
    if (verdict_.doubt) step_promptness_.doubted(received.promptness);
    if (verdict_.doubt && !arrival && !received.clock_contradicted &&
        may_adopt(received, *verdict_.doubt)) {
        filter_.adopt(received);
        verdict_.step = std::exchange(verdict_.doubt, std::nullopt);
    }
    if (!verdict_.doubt) step_promptness_.believed();
    if (verdict_.doubt && received.commanded.ns == 0) filter_.believed().see(received.record);
    return verdict_;
}

bool RecordFilter::may_adopt(const ReceivedRecord& received, const Implausibility& doubt) {
    if (received.promptness == Promptness::not_recorded) return filter_.stepped(received.exchanges);
    if (const auto on_grid = filter_.believed().on_grid(received))
        return *on_grid ? filter_.stepped(received.exchanges)
                        : filter_.prevailed(received.exchanges, most_to_prevail);
    const bool confirmed =
        doubt.reason == EventReason::implausible_number
            ? filter_.believed().only_skips(received.record)
            : arrival_confirms(received.promptness, {doubt.said - doubt.expected}) &&
                  !step_promptness_.mostly_early();
    return confirmed ? filter_.stepped(received.exchanges)
                     : filter_.prevailed(received.exchanges, step_promptness_.least_to_prevail());
}

}  // namespace versavis::pairing
