// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/stream_witnesses.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/rounding.hpp"

namespace versavis::clock {

namespace {

/// What the quickest of one moment differ by on a quiet link without a fault.
constexpr Duration link_noise = microseconds(50);

/// What a value may change by in a second once it is known: 0.2 us. The delays of a link do not
/// wander faster, and a drift of 1 us/s is found before it amounts to 0.1 ms.
constexpr std::int64_t slowest_drift = 5'000'000;

/// Values until what is usual is known: from then on it may only creep.
constexpr int values_to_know = 32;

/// Mean deviations that an honest lead stays within: delays spread exponentially, and one of a
/// million may be so far off.
constexpr double deviations = 10;

/// A stream that departed must come back to one over this of what it may be off, ...
constexpr std::int64_t parts_to_return = 2;

/// ... and one may be off by one over this to steer the clock, which would follow it.
constexpr std::int64_t parts_to_steer = 4;

/// Exchanges that follow each other sooner end one interval.
constexpr Duration shortest_interval = milliseconds(50);

/// Messages of which the quickest says how long they take, and the oldest intervals that they may
/// be from: a camera of 10 Hz has as many between 16 exchanges of a second and a half.
constexpr int messages_to_compare = 12;
constexpr std::size_t most_intervals = 16;

/// Intervals in a row without a message, after which older ones are past.
constexpr int intervals_to_end = 3;

/// Answers that the quickest is taken of.
constexpr std::size_t answers_to_compare = 16;

/// Intervals in a row that a stream must be late in: a busy host may be late in one or two, and one
/// wrong answer is among the newest for two.
constexpr std::size_t intervals_to_be_late = 3;

/// Streams that must agree that exchanges are wrong, or the clock stepped: one alone may be wrong
/// itself.
constexpr int streams_to_agree = 2;

/// The answer on its way to the host.
OffsetSample up(const Exchange& exchange) {
    return {exchange.answered, {exchange.arrived.ns - exchange.answered.ns}};
}

/// `passed` in creeping.
Duration crept(Duration passed) {
    return std::clamp(passed, Duration{}, seconds(5)) / slowest_drift;
}

}  // namespace

bool UsualLead::known() const { return count_ >= values_to_know; }

Duration UsualLead::departure(Duration value, std::int64_t parts) const {
    if (!known()) return {};
    const Duration off = value - value_;
    const Duration allowed = link_noise + rounded(deviations * deviation_ns_);
    return absolute(off) > allowed / parts ? off : Duration{};
}

void UsualLead::learn(Duration value, HostTime now) {
    const Duration reach = crept(now - newest_);
    newest_ = now;
    const bool settled = known();
    if (count_ == 0) value_ = value;
    count_ = std::min(count_ + 1, values_to_know);
    const Duration off = value - value_;
    value_ = value_ + (settled ? std::clamp(off / count_, -reach, reach) : off / count_);
    deviation_ns_ += (std::abs(static_cast<double>(off.ns)) - deviation_ns_) / count_;
    if (settled)
        deviation_ns_ = std::min(deviation_ns_, widest_ns_);
    else
        widest_ns_ = 2 * deviation_ns_ + static_cast<double>(link_noise.ns) / (2 * deviations);
}

void StreamWitnesses::Interval::add(const OffsetSample& message) {
    ++messages;
    if (!quickest || message.host_minus_board < quickest->host_minus_board) quickest = message;
}

void StreamWitnesses::Track::close() {
    closed.push_front(std::exchange(open, {}));
    if (closed.size() > most_intervals) closed.pop_back();
}

/// For long enough that older messages are past.
bool StreamWitnesses::Track::silent() const {
    return closed.size() >= intervals_to_end &&
           std::all_of(closed.begin(), closed.begin() + intervals_to_end,
                       [](const Interval& interval) { return interval.messages == 0; });
}

std::optional<OffsetSample> StreamWitnesses::Track::quickest(const StreamWitnesses& at) const {
    std::optional<OffsetSample> best;
    int messages = 0;
    int silent = 0;
    for (const Interval& interval : closed) {
        silent = interval.messages > 0 ? 0 : silent + 1;
        if (silent == intervals_to_end) return std::nullopt;
        messages += interval.messages;
        if (interval.quickest && (!best || at.aligned(*interval.quickest) < at.aligned(*best)))
            best = interval.quickest;
        if (messages >= messages_to_compare) return best;
    }
    return std::nullopt;
}

void StreamWitnesses::Stream::forget_lead() {
    lead = {};
    persistence.forget();
    departure = unusual = {};
    late = 0;
}

std::size_t StreamWitnesses::add_stream(Witness witness) {
    streams_.emplace_back();
    streams_.back().witness = witness;
    return streams_.size() - 1;
}

void StreamWitnesses::heard(std::size_t stream, const OffsetSample& message, bool fits) {
    (fits ? streams_[stream].fitting : streams_[stream].others).open.add(message);
}

/// Host minus board time as the clocks run apart from then until now.
Duration StreamWitnesses::aligned(const OffsetSample& sample) const {
    const double since_s = static_cast<double>((now_ - sample.at).ns) * 1e-9;
    return sample.host_minus_board + rounded(skew_ * since_s);
}

/// Of so many answers, of which there must be `answers_to_compare`.
Duration StreamWitnesses::quickest_answer(std::size_t newest) const {
    Duration quickest = aligned(answers_.front());
    for (std::size_t i = 1; i < newest; ++i) quickest = std::min(quickest, aligned(answers_[i]));
    return quickest;
}

bool StreamWitnesses::deny(const Exchange& exchange) const {
    const Duration answer = aligned(up(exchange));
    // The answer may have taken longer than the quickest do, but not for longer than the exchange.
    const Duration slack =
        (exchange.arrived - exchange.sent) - (exchange.answered - exchange.received);
    bool denied = false;
    for (std::size_t i = 0; i < streams_.size(); ++i) {
        const Stream& stream = streams_[i];
        const auto& quickest = stream.fitting.open.quickest;
        if (!quickest || !stream.lead.known() || departure(i)) continue;
        const Duration lead = aligned(*quickest) - answer;
        const Duration least = stream.lead.departure(lead);
        const Duration most = stream.lead.departure(lead + slack);
        if (least <= Duration{} && most >= Duration{}) return false;
        denied = true;
    }
    return denied;
}

void StreamWitnesses::exchanged(const Exchange& exchange, double skew) {
    skew_ = skew;
    now_ = exchange.answered;
    answers_.push_front(up(exchange));
    if (answers_.size() > answers_to_compare) answers_.pop_back();
    if (exchange.arrived - closed_ >= shortest_interval) close_interval(exchange.arrived);
}

void StreamWitnesses::close_interval(HostTime now) {
    closed_ = now;
    for (Stream& stream : streams_) {
        stream.fitting.close();
        stream.others.close();
    }
    if (answers_.size() < answers_to_compare) return;
    const Answers quickest{quickest_answer(answers_to_compare),
                           quickest_answer(intervals_to_be_late - 1)};
    for (Stream& stream : streams_) compare(stream, quickest, now);
    doubt_ = common(&Stream::departure);
    const Duration unusual = common(&Stream::unusual);
    all_unusual_ = unusual > Duration{};
    allowance_ = too_new() ? link_noise : unusual;
}

bool StreamWitnesses::talks(const Stream& stream) const {
    return stream.witness != Witness::none && stream.fitting.quickest(*this);
}

/// Streams enough talk, and it is not yet known how long they usually take.
bool StreamWitnesses::too_new() const {
    int talking = 0;
    int known = 0;
    for (const Stream& stream : streams_) {
        if (!talks(stream)) continue;
        ++talking;
        known += stream.lead.known() ? 1 : 0;
    }
    return talking >= streams_to_agree && known < streams_to_agree;
}

/// The least of what all streams that may be compared are off by to the same side; 0: they are not.
Duration StreamWitnesses::common(Duration Stream::*off) const {
    Duration least;
    int streams = 0;
    for (const Stream& stream : streams_) {
        if (!stream.lead.known() || !talks(stream)) continue;
        const Duration by = stream.*off;
        if (by == Duration{} || (streams > 0 && (least.ns > 0) != (by.ns > 0))) return {};
        if (streams == 0 || absolute(by) < absolute(least)) least = by;
        ++streams;
    }
    return streams < streams_to_agree ? Duration{} : absolute(least);
}

void StreamWitnesses::compare(Stream& stream, const Answers& quickest_answers, HostTime now) {
    const Duration answer = quickest_answers.all;
    const auto others = stream.others.quickest(*this);
    stream.others_confirmed = others && stream.lead.known() &&
                              stream.lead.departure(aligned(*others) - answer) == Duration{};
    const auto quickest = stream.fitting.quickest(*this);
    if (!quickest) return;
    const Duration lead = aligned(*quickest) - answer;
    const bool departed = stream.departure != Duration{};
    const Duration off = stream.lead.departure(lead, departed ? parts_to_return : 1);
    stream.unusual = -stream.lead.departure(lead, parts_to_steer);
    // Where the newest answers are as late, the link became slower.
    const bool link_is_slower =
        !departed && off > Duration{} &&
        stream.lead.departure(aligned(*quickest) - quickest_answers.newest) <= Duration{};
    if (off == Duration{} || link_is_slower) {
        if (off == Duration{}) stream.lead.learn(lead, now);
        stream.departure = {};
        stream.late = 0;
        stream.persistence.agree();
        return;
    }
    if (stream.persistence.contradict(doubt_ == Duration{} ? least_to_prevail : most_to_prevail))
        return stream.forget_lead();
    stream.late = off > Duration{} ? stream.late + 1 : 0;
    if (off < Duration{} || stream.late >= intervals_to_be_late) stream.departure = -off;
}

std::optional<Duration> StreamWitnesses::departure(std::size_t stream) const {
    const Duration departure = doubt_ == Duration{} ? streams_[stream].departure : Duration{};
    return departure == Duration{} ? std::nullopt : std::optional(departure);
}

bool StreamWitnesses::steers(std::size_t stream) const {
    return streams_[stream].unusual == Duration{} || all_unusual_;
}

std::optional<bool> StreamWitnesses::confirms_others(std::size_t stream) const {
    if (!streams_[stream].lead.known()) return std::nullopt;
    return streams_[stream].others_confirmed;
}

bool StreamWitnesses::show_clock_step() const {
    int own = 0;
    bool grid = false;
    for (const Stream& stream : streams_) {
        if (!stream.fitting.silent()) return false;
        if (!stream.others_confirmed) continue;
        if (stream.witness == Witness::own) ++own;
        if (stream.witness == Witness::grid) grid = true;
    }
    return own + (grid ? 1 : 0) >= streams_to_agree;
}

void StreamWitnesses::clock_stepped() {
    answers_.clear();
    allowance_ = doubt_;  // exchanges that were in doubt are until streams confirm them
    doubt_ = {};
    all_unusual_ = false;
    for (Stream& stream : streams_) {
        stream.fitting = {};
        stream.others = {};
        stream.departure = stream.unusual = {};
        stream.late = 0;
        stream.others_confirmed = false;
    }
}

}  // namespace versavis::clock
