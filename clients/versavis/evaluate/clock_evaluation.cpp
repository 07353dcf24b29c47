// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/clock_evaluation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/plausible_time.hpp"
#include "clock/clock_history.hpp"
#include "engine/rounding.hpp"

namespace versavis::client {

namespace {

using namespace clock;
using nlohmann::json;

// The estimate starts with the recording, and is settled after this. If lower, its beginning is
// judged as well; if higher, short recordings have nothing left to judge.
constexpr double settling_s = 20;

// A shorter recording has only a handful of exchanges.
constexpr double least_s = 10;

// How long a reading of the output clock holds after it. It is read once a second. If lower, one
// that came late makes a gap; if higher, a slewed clock is 0.5 us further off.
constexpr Duration reading_holds = seconds(2);

constexpr std::int64_t second_ns = 1'000'000'000;

/// ns from the nearest whole second.
double off_second(OutputTime time) {
    std::int64_t rest = time.ns % second_ns;
    if (rest < 0) rest += second_ns;
    return static_cast<double>(rest < second_ns / 2 ? rest : rest - second_ns);
}

class SpreadOf {
 public:
    void add(double value, double sigma = 0) {
        values_.push_back(value);
        if (sigma > 0) squares_ += value * value / (sigma * sigma), ++judged_;
    }

    Spread spread() const {
        Spread result;
        result.count = values_.size();
        if (values_.empty()) return result;
        std::vector<double> amounts;
        for (const double value : values_) {
            result.mean += value;
            result.rms += value * value;
            amounts.push_back(std::abs(value));
        }
        const auto count = static_cast<double>(values_.size());
        result.mean /= count;
        result.rms = std::sqrt(result.rms / count);
        std::sort(amounts.begin(), amounts.end());
        result.most = amounts.back();
        result.p99 = amounts[(amounts.size() - 1) * 99 / 100];
        if (judged_ > 0) result.nees = squares_ / static_cast<double>(judged_);
        return result;
    }

 private:
    std::vector<double> values_;
    double squares_ = 0;
    std::uint64_t judged_ = 0;
};

/// Sorts the items of the ring `clock`.
class ClockItems {
 public:
    explicit ClockItems(RecordedClocks& clocks) : clocks_(clocks) {}

    void add(const ClockItem& item) {
        std::visit([this](const auto& recorded) { take(recorded); }, item);
    }

 private:
    BoardLife& life(std::uint32_t nonce) {
        for (BoardLife& known : clocks_.lives)
            if (known.nonce == nonce) return known;
        clocks_.lives.push_back({nonce, {}, 0});
        return clocks_.lives.back();
    }

    void take(const RecordedExchange& recorded) {
        if (!is_plausible(recorded.sent.ns) || !is_plausible(recorded.received.ns) ||
            !is_plausible(recorded.answered.ns) || !is_plausible(recorded.arrived.ns))
            return;
        BoardLife& known = life(recorded.nonce);
        known.stamps.messages.push_back(
            {recorded.arrived,
             Exchange{recorded.sent, recorded.received, recorded.answered, recorded.arrived}});
        ++known.exchanges;
    }
    void take(const RecordedMessage& recorded) {
        if (!is_plausible(recorded.departed.ns) || !is_plausible(recorded.arrived.ns)) return;
        life(recorded.nonce)
            .stamps.messages.push_back(
                {recorded.arrived, OneWay{recorded.departed, recorded.arrived}});
    }
    void take(const RecordedRestart& recorded) { life(recorded.nonce); }
    void take(const RecordedOutput& recorded) {
        if (is_plausible(recorded.host.ns) && is_plausible(recorded.minus_host.ns))
            clocks_.outputs.push_back(recorded);
    }

    RecordedClocks& clocks_;
};

void add_event(const RecordedItem& item, RecordedClocks& clocks) {
    const auto event = unpack<EventMetadata>(item.metadata);
    if (event.kind == EventKind::utc_label) clocks.labelled = true;
    if (event.kind != EventKind::pps || (event.flags & flag_suspect) != 0) return;
    if (!is_plausible(event.board_time.ns) || !is_plausible(event.host_time.ns)) return;
    const bool known = event.sigma_ns != sigma_unknown;
    clocks.pulses.push_back({event.board_time,
                             event.host_time,
                             item.time,
                             {known ? std::int64_t{event.sigma_ns} : std::int64_t{-1}}});
}

/// What the messages say, of those in the recording from when they are settled.
Expected<> judge_messages(const BoardLife& life, ClockEvaluation& evaluation) {
    const auto estimator = make_estimator(EstimatorKind::envelope);
    const std::vector<ClockPoint> history = clock_history(life.stamps, *estimator);
    if (history.empty())
        return failure("clock",
                       "no exchange with the board is valid: none has a positive round trip",
                       "record again, and check the clock in 'versavis status'");
    evaluation.skew_ppm = history.back().skew_ppm;
    SpreadOf innovation;
    SpreadOf residual;
    for (const ClockPoint& point : history) {
        if (point.time_s < evaluation.settled_s) continue;
        innovation.add(point.innovation_ns);
        residual.add(point.residual_ns, point.sigma_ns);
    }
    evaluation.innovation = innovation.spread();
    evaluation.residual = residual.spread();
    evaluation.residual.nees = 0;  // most of it is the messages' delay, which sigma is not of
    std::vector<ClockQuery> queries;
    const HostTime settled = life.stamps.messages.front().available +
                             Duration{static_cast<std::int64_t>(evaluation.settled_s * 1e9)};
    for (const TimedMessage& message : life.stamps.messages) {
        const auto* exchange = std::get_if<Exchange>(&message.message);
        if (exchange != nullptr && message.available >= settled)
            queries.push_back({message.available, exchange->received});
    }
    const auto fresh = make_estimator(EstimatorKind::envelope);
    const ClockAnswers live = replayed_answers(life.stamps.messages, queries, *fresh);
    const ClockAnswers best = smoothed_answers(life.stamps.messages, queries);
    SpreadOf off;
    for (std::size_t i = 0; i < queries.size(); ++i)
        off.add(static_cast<double>((live[i].time - best[i].time).ns),
                static_cast<double>(live[i].sigma.ns));
    evaluation.live = off.spread();
    return {};
}

void judge_pulses(const RecordedClocks& clocks, const BoardLife& life,
                  ClockEvaluation& evaluation) {
    SpreadOf published;
    for (const PpsPulse& pulse : clocks.pulses)
        published.add(off_second(pulse.published), static_cast<double>(pulse.sigma.ns));
    evaluation.pps_published = published.spread();
    // Live, a pulse was translated soon after it: by what was known a tenth of a second later.
    const Smoother smoother([&] {
        std::vector<Message> messages;
        for (const TimedMessage& message : life.stamps.messages)
            messages.push_back(message.message);
        return messages;
    }());
    const HostTime settled = life.stamps.messages.front().available +
                             Duration{static_cast<std::int64_t>(evaluation.settled_s * 1e9)};
    std::vector<ClockQuery> queries;
    std::vector<HostEstimate> smoothed;
    for (const PpsPulse& pulse : clocks.pulses) {
        const HostEstimate best = smoother.translate(pulse.board);
        if (best.state != ClockState::locked || best.time < settled) continue;
        if (absolute(best.time - pulse.host) > same_life) continue;
        queries.push_back({best.time + milliseconds(100), pulse.board});
        smoothed.push_back(best);
    }
    const auto estimator = make_estimator(EstimatorKind::envelope);
    const ClockAnswers answers = replayed_answers(life.stamps.messages, queries, *estimator);
    SpreadOf link;
    SpreadOf by_all;
    for (std::size_t i = 0; i < queries.size(); ++i) {
        const auto difference = output_minus_host(clocks.outputs, smoothed[i].time);
        if (!difference) continue;
        const auto off = [&](const HostEstimate& estimate) {
            return off_second({(estimate.time + *difference).ns});
        };
        link.add(off(answers[i]), static_cast<double>(answers[i].sigma.ns));
        by_all.add(off(smoothed[i]), static_cast<double>(smoothed[i].sigma.ns));
    }
    evaluation.pps_link = link.spread();
    evaluation.pps_smoothed = by_all.spread();
}

json spread_json(const Spread& spread) {
    if (spread.count == 0) return nullptr;
    return {{"count", spread.count},
            {"mean_ns", spread.mean},
            {"rms_ns", spread.rms},
            {"p99_ns", spread.p99},
            {"max_ns", spread.most},
            {"mean_square_in_sigmas", spread.nees > 0 ? json(spread.nees) : json(nullptr)}};
}

std::string spread_text(const char* what, const Spread& spread) {
    if (spread.count == 0) return "";
    std::string text =
        fmt::format("  {:<44} mean {:9.2f}  rms {:8.2f}  p99 {:8.2f}  max {:8.2f} us", what,
                    spread.mean * 1e-3, spread.rms * 1e-3, spread.p99 * 1e-3, spread.most * 1e-3);
    if (spread.nees > 0) text += fmt::format("  ({:.2f} sigma rms)", std::sqrt(spread.nees));
    return text + "\n";
}

}  // namespace

std::optional<Duration> output_minus_host(const std::vector<RecordedOutput>& outputs, HostTime at) {
    const auto after = std::upper_bound(
        outputs.begin(), outputs.end(), at,
        [](HostTime host, const RecordedOutput& output) { return host < output.host; });
    if (after == outputs.begin()) return std::nullopt;
    const RecordedOutput& before = *(after - 1);
    if (after == outputs.end() || after->epoch != before.epoch) {
        if (at - before.host > reading_holds) return std::nullopt;
        return before.minus_host;
    }
    if (after->host == before.host) return before.minus_host;
    const double share = static_cast<double>((at - before.host).ns) /
                         static_cast<double>((after->host - before.host).ns);
    const auto change = static_cast<double>((after->minus_host - before.minus_host).ns);
    return before.minus_host + rounded(share * change);
}

Expected<RecordedClocks> read_clocks(const Recording& recording,
                                     const std::function<bool()>& go_on) {
    RecordedClocks clocks;
    ClockItems items(clocks);
    bool stopped = false;
    std::vector<std::string> streams;
    for (const RecordedStream& stream : recording.streams())
        if (stream.kind == ring::StreamKind::clock || stream.kind == ring::StreamKind::events)
            streams.push_back(stream.name);
    if (streams.empty())
        return failure("recording", "has no stamps of the clock",
                       "record the stream clock, and events for PPS");
    const auto read = recording.glance(streams, [&](const RecordedItem& item) {
        if (item.kind == ring::StreamKind::clock) {
            const auto recorded = from_metadata(unpack<ClockMetadata>(item.metadata));
            if (recorded) items.add(*recorded);
        } else {
            add_event(item, clocks);
        }
        stopped = !go_on();
        return !stopped;
    });
    if (!read) return Unexpected(read.error());
    if (stopped) return failure("clock", "stopped before the end of the recording");
    std::stable_sort(clocks.outputs.begin(), clocks.outputs.end(),
                     [](const auto& a, const auto& b) { return a.host < b.host; });
    for (BoardLife& life : clocks.lives)
        std::stable_sort(life.stamps.messages.begin(), life.stamps.messages.end(),
                         [](const auto& a, const auto& b) { return a.available < b.available; });
    return clocks;
}

Expected<ClockEvaluation> evaluate_clock(const RecordedClocks& clocks) {
    ClockEvaluation evaluation;
    const BoardLife* longest = nullptr;
    for (const BoardLife& life : clocks.lives) {
        if (life.exchanges == 0) continue;
        ++evaluation.lives;
        if (longest == nullptr || life.exchanges > longest->exchanges) longest = &life;
    }
    if (longest == nullptr)
        return failure("clock", "the recording holds no exchange with the board",
                       "record while a board is connected, with the stream clock");
    const auto& messages = longest->stamps.messages;
    evaluation.exchanges = longest->exchanges;
    evaluation.one_way = messages.size() - longest->exchanges;
    evaluation.duration_s =
        static_cast<double>((messages.back().available - messages.front().available).ns) * 1e-9;
    if (evaluation.duration_s < least_s)
        return failure("clock", fmt::format("{:.1f} s are too few", evaluation.duration_s),
                       "record a minute or more");
    evaluation.settled_s = std::min(settling_s, evaluation.duration_s / 2);
    if (evaluation.lives > 1)
        evaluation.notes.push_back(fmt::format(
            "the board restarted: the longest of {} runs is evaluated", evaluation.lives));
    if (auto judged = judge_messages(*longest, evaluation); !judged)
        return Unexpected(judged.error());
    evaluation.labelled = clocks.labelled;
    if (!clocks.pulses.empty()) judge_pulses(clocks, *longest, evaluation);
    if (clocks.pulses.empty())
        evaluation.notes.emplace_back(
            "without PPS, an error common to all messages, as from unequal delays of the two "
            "directions, is invisible");
    else if (!clocks.labelled)
        evaluation.notes.emplace_back(
            "no receiver named the seconds: the comparison with PPS includes the error of the "
            "host's clock");
    return evaluation;
}

json to_json(const ClockEvaluation& evaluation) {
    return {{"board_lives", evaluation.lives},
            {"exchanges", evaluation.exchanges},
            {"one_way_messages", evaluation.one_way},
            {"duration_s", evaluation.duration_s},
            {"settled_s", evaluation.settled_s},
            {"skew_ppm", evaluation.skew_ppm},
            {"innovation", spread_json(evaluation.innovation)},
            {"residual", spread_json(evaluation.residual)},
            {"live_against_smoothed", spread_json(evaluation.live)},
            {"seconds_named", evaluation.labelled},
            {"pps_published", spread_json(evaluation.pps_published)},
            {"pps_by_messages", spread_json(evaluation.pps_link)},
            {"pps_by_all_messages", spread_json(evaluation.pps_smoothed)},
            {"notes", evaluation.notes}};
}

std::string to_text(const ClockEvaluation& evaluation) {
    std::string text = fmt::format(
        "{} exchanges and {} one-way messages in {:.0f} s; host against board {:+.3f} ppm\n"
        "after {:.0f} s of settling:\n",
        evaluation.exchanges, evaluation.one_way, evaluation.duration_s, evaluation.skew_ppm,
        evaluation.settled_s);
    text += spread_text("innovation: how far a message moved it", evaluation.innovation);
    text += spread_text("residual: middle of an exchange", evaluation.residual);
    text += spread_text("live estimate against smoothed", evaluation.live);
    if (evaluation.pps_published.count > 0) text += "PPS pulses against whole seconds:\n";
    text += spread_text("as published", evaluation.pps_published);
    text += spread_text("by messages alone, live", evaluation.pps_link);
    text += spread_text("by messages alone, smoothed", evaluation.pps_smoothed);
    for (const std::string& note : evaluation.notes) text += "note: " + note + "\n";
    return text;
}

}  // namespace versavis::client
