// SPDX-License-Identifier: BSD-3-Clause
#include "verify/clock_witness.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace versavis::client {

namespace {

constexpr std::int64_t most_sigmas = 4;

/// Rounding, and slopes that change within a second.
constexpr Duration rounding = microseconds(2);

/// A stamp may come so long after the last message of the board's life: the service extrapolates.
constexpr Duration after_life = seconds(10);

/// The output clock is read once a second. What NTP slews meanwhile, 500 ppm at most, is allowed.
constexpr Duration reading_apart = milliseconds(2'500);
constexpr double slewed = 500e-6;

/// By how much a reading of the output clock may be off on a busy host. Stamps by arrival, which
/// claim no accuracy, are made with one.
constexpr Duration reading_error = microseconds(100);

/// So close to a whole number of seconds is no accident.
constexpr Duration near_second = milliseconds(10);

std::int64_t tai_minus_utc_s() { return 37; }  // since 2017

bool whole_seconds(Duration off) {
    const std::int64_t rest = std::llabs(off.ns) % seconds(1).ns;
    return std::llabs(off.ns) > seconds(1).ns / 2 &&
           std::min(rest, seconds(1).ns - rest) < near_second.ns;
}

/// A stamp that was held back so that time does not step backwards may be late by any amount.
bool within_error(Duration off, const StampTimes& stamp) {
    const bool held = (stamp.flags & flag_clamped) != 0;
    return absolute(off) <= allowed_error(stamp.sigma_ns) || (held && off.ns > 0);
}

Finding output_finding(Duration off) {
    return whole_seconds(off) ? Finding::other_second : Finding::output_time;
}

template <class Dated>
bool by_epoch_and_host(const Dated& a, const Dated& b) {
    return a.epoch != b.epoch ? a.epoch < b.epoch : a.host < b.host;
}

}  // namespace

Duration allowed_error(std::uint32_t sigma_ns) {
    const std::int64_t known = sigma_ns == sigma_unknown ? 0 : std::int64_t{sigma_ns};
    return Duration{known} * most_sigmas + rounding;
}

ClockWitness::ClockWitness(const ClockEvidence& evidence, const std::string& output_clock)
    : outputs_(evidence.outputs), pulses_(evidence.pulses) {
    struct Life {
        std::vector<ClockExchange> exchanges;
        std::vector<ClockMessage> messages;
    };
    std::map<std::uint32_t, Life> lives;
    for (const ClockExchange& each : evidence.exchanges)
        lives[each.nonce].exchanges.push_back(each);
    for (const ClockMessage& each : evidence.messages) lives[each.nonce].messages.push_back(each);
    for (auto& [nonce, life] : lives)
        lives_.emplace_back(std::move(life.exchanges), std::move(life.messages));
    std::sort(outputs_.begin(), outputs_.end(), by_epoch_and_host<OutputReading>);
    std::sort(pulses_.begin(), pulses_.end(), by_epoch_and_host<NamedPulse>);
    if (output_clock == "tai") output_minus_utc_s_ = tai_minus_utc_s();
}

const ClockBounds* ClockWitness::life(BoardTime board, HostTime host) const {
    const ClockBounds* best = nullptr;
    Duration least;
    for (const ClockBounds& life : lives_) {
        if (life.exchanges() == 0 || host < life.begin() - after_life ||
            host > life.end() + after_life)
            continue;
        const auto interval = life.at(board);
        // One whose bounds are not known fits worse than any.
        const Duration off = interval ? absolute(interval->outside(host)) : after_life * 100;
        if (best != nullptr && off >= least) continue;
        best = &life;
        least = off;
    }
    return best;
}

Duration ClockWitness::outside_bounds(BoardTime board, HostTime host) const {
    const ClockBounds* found = life(board, host);
    const auto interval = found == nullptr ? std::nullopt : found->at(board);
    return interval ? interval->outside(host) : Duration{};
}

void ClockWitness::judge(const StampTimes& stamp, VerdictBuilder& verdict) const {
    if (stamp.sigma_ns == sigma_unknown) verdict.add(Finding::clock_uncertain);
    judge_host(stamp, verdict);
    judge_output(stamp, verdict);
    if ((stamp.flags & flag_second_doubted) != 0) verdict.add(Finding::second_doubted);
}

void ClockWitness::judge_host(const StampTimes& stamp, VerdictBuilder& verdict) const {
    const ClockBounds* found = life(stamp.board, stamp.host);
    if (found == nullptr) {
        const bool recorded = std::any_of(lives_.begin(), lives_.end(), [&](const auto& each) {
            return each.at(stamp.board).has_value();
        });
        verdict.add(recorded ? Finding::host_time : Finding::no_exchange);
        return;
    }
    const auto interval = found->at(stamp.board);
    if (!interval) {
        verdict.add(found->contradictory(stamp.board) ? Finding::contradictory_exchanges
                                                      : Finding::no_exchange);
        return;
    }
    const HostTime centre = middle(interval->earliest, interval->latest);
    verdict.add_position(stamp.host - centre, (interval->latest - interval->earliest) / 2);
    const Duration outside = interval->outside(stamp.host);
    if (absolute(outside) > allowed_error(stamp.sigma_ns)) verdict.add(Finding::host_time, outside);
}

/// Against the readings of the output clock around it.
std::optional<Duration> ClockWitness::off_host_clock(const StampTimes& stamp) const {
    const OutputReading wanted{stamp.epoch, stamp.host, {}, {}};
    const auto after = std::upper_bound(outputs_.begin(), outputs_.end(), wanted,
                                        by_epoch_and_host<OutputReading>);
    std::optional<Duration> lowest;
    std::optional<Duration> highest;
    const auto take = [&](const OutputReading& reading) {
        const Duration apart = absolute(reading.host - stamp.host);
        if (reading.epoch != stamp.epoch || apart > reading_apart) return;
        const Duration slack =
            reading.uncertainty + rounding +
            Duration{static_cast<std::int64_t>(static_cast<double>(apart.ns) * slewed)};
        const Duration low = reading.minus_host - slack;
        const Duration high = reading.minus_host + slack;
        lowest = lowest ? std::max(*lowest, low) : low;
        highest = highest ? std::min(*highest, high) : high;
    };
    if (after != outputs_.begin()) take(*std::prev(after));
    if (after != outputs_.end()) take(*after);
    if (!lowest) return std::nullopt;
    if (*highest < *lowest) std::swap(*lowest, *highest);
    const Duration minus_host = OutputTime{stamp.output.ns} - OutputTime{stamp.host.ns};
    if (minus_host < *lowest) return minus_host - *lowest;
    return minus_host > *highest ? minus_host - *highest : Duration{};
}

/// Against the named pulses around it.
std::optional<Duration> ClockWitness::off_pulses(const StampTimes& stamp) const {
    constexpr Duration pulse_holds = seconds(70);  // as the service extrapolates, and some
    const NamedPulse wanted{stamp.epoch, stamp.board, stamp.host, 0};
    const auto after =
        std::upper_bound(pulses_.begin(), pulses_.end(), wanted, by_epoch_and_host<NamedPulse>);
    const auto fits = [&](const NamedPulse& pulse) {
        return pulse.epoch == stamp.epoch && absolute(pulse.host - stamp.host) < pulse_holds;
    };
    const NamedPulse* before =
        after != pulses_.begin() && fits(*std::prev(after)) ? &*std::prev(after) : nullptr;
    const NamedPulse* next = after != pulses_.end() && fits(*after) ? &*after : nullptr;
    const NamedPulse* from = before != nullptr ? before : next;
    if (from == nullptr) return std::nullopt;
    // A second pulse, for the rate of the board's crystal.
    const NamedPulse* other = before != nullptr ? next : nullptr;
    if (other == nullptr && before != nullptr && std::prev(after) != pulses_.begin() &&
        fits(*std::prev(after, 2)))
        other = &*std::prev(after, 2);
    double rate = 1;
    if (other != nullptr && other->board != from->board) {
        rate = static_cast<double>((other->utc_s - from->utc_s) * seconds(1).ns) /
               static_cast<double>((other->board - from->board).ns);
        if (std::abs(rate - 1) > slewed) return std::nullopt;
    }
    const double since = static_cast<double>((stamp.board - from->board).ns) * rate;
    const OutputTime then{(from->utc_s + output_minus_utc_s_) * seconds(1).ns +
                          static_cast<std::int64_t>(std::llround(since))};
    return stamp.output - then;
}

void ClockWitness::judge_output(const StampTimes& stamp, VerdictBuilder& verdict) const {
    const auto by_host = off_host_clock(stamp);
    const auto by_pulses = off_pulses(stamp);
    if (!by_host && !by_pulses) {
        verdict.add(Finding::no_output_reading);
        return;
    }
    const auto fits = [&](const std::optional<Duration>& off) {
        return off && within_error(*off, stamp);
    };
    if (fits(by_host)) return;
    if (fits(by_pulses)) {
        const bool said = (stamp.flags & flag_second_doubted) != 0;
        if (by_host && whole_seconds(*by_host) && !said)
            verdict.add(Finding::other_second, *by_host);
        return;
    }
    const Duration off = by_host ? *by_host : *by_pulses;
    verdict.add(output_finding(off), off);
}

void ClockWitness::judge_by_host_clock(const StampTimes& stamp, VerdictBuilder& verdict) const {
    const auto off = off_host_clock(stamp);
    const bool claims_none = stamp.sigma_ns == sigma_unknown;
    if (!off)
        verdict.add(Finding::no_output_reading);
    else if (!within_error(*off, stamp) && !(claims_none && absolute(*off) <= reading_error))
        verdict.add(output_finding(*off), *off);
}

}  // namespace versavis::client
