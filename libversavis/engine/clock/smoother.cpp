// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/smoother.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "engine/clock/gaussian_state_matrix.hpp"
#include "engine/clock/square.hpp"
#include "engine/rounding.hpp"

namespace versavis::clock {

namespace {

// Passes over a recording. Half: sites are not settled. Twice: takes twice the time and gains
// nothing.
constexpr int sweeps = 5;

// Share of a site's change that a sweep makes: expectation propagation may swing. Half: it is not
// settled after the sweeps. Twice exceeds one, and swings.
constexpr double damping = 0.6;

// Messages on each side whose delays give the scale of one. Half: scales scatter by 1.4 times as
// much. Twice: bursts of load are blurred.
constexpr std::size_t neighbours = 32;

// Early messages are thinned to the shortest delay of this time, as in later slots. Half or
// twice: those of the first half minute count for more or less than they say.
constexpr Duration slot = seconds(2);

// How long slots are short after a beginning. Half: some short ones are judged by the delays of
// long ones. Twice: nothing changes.
constexpr Duration short_slots = seconds(32);

// Below this share of the precision, nothing but the message itself is known of its level, and it
// keeps its weight. Half or twice matters at the ends of a recording.
constexpr double least_of_others = 0.01;

// How far from its messages a segment counts as locked; as in the filter. Half or twice: only the
// state changes.
constexpr Duration longest_silence = seconds(3);

// Share of the difference of overshoots that is subtracted: some links need a quarter of it, others
// all. Half: late wake-ups cost a sixth more, and NEES there rises to 2.2. Twice: USB costs half
// more.
constexpr double overshoot_share = 0.6;

// How much of that difference is in doubt. Half: sigma at one exchange a second is too small, with
// an NEES of 2.9. Twice: sigma over USB is too large.
constexpr double overshoot_doubt = 0.45;

// Windows after an instant that its shape of delays is averaged over, half of all. Half or twice
// matters where a link changed within minutes.
constexpr std::size_t later_windows = 128;

StateVector level_now(Direction direction) {
    return level_by_component(static_cast<double>(direction), {});
}

}  // namespace

bool Smoother::earlier(const SmootherStep& a, const SmootherStep& b) {
    return a.site.sample.at < b.site.sample.at;
}

Smoother::Smoother(const std::vector<Message>& messages, const std::optional<Asymmetry>& asymmetry)
    : asymmetry_(asymmetry) {
    std::vector<EdgeSite> sites;
    EnvelopeFilter filter;
    filter.record(sites);
    for (const Message& message : messages)
        std::visit([&](const auto& m) { filter.add(m); }, message);
    for (std::size_t first = 0; first < sites.size();) {
        std::size_t last = first;
        while (last < sites.size() && sites[last].restarts == sites[first].restarts) ++last;
        segments_.push_back(begin(sites, first, last));
        first = last;
    }
    for (Segment& segment : segments_) {
        pass_forth(segment, true);
        pass_back(segment);
        thin(segment);
        for (int sweep = 1; sweep < sweeps; ++sweep) {
            rescale(segment, Direction::to_host);
            rescale(segment, Direction::to_board);
            weigh(segment);
            pass_forth(segment, false);
            pass_back(segment);
        }
        if (!asymmetry_) presume_asymmetry(segment);
    }
}

/// The first two sites are the filter's first exchange.
Smoother::Segment Smoother::begin(const std::vector<EdgeSite>& sites, std::size_t first,
                                  std::size_t last) {
    Segment segment;
    const Duration down = sites[first].sample.host_minus_board;
    const Duration up = sites[first + 1].sample.host_minus_board;
    segment.base = down + (up - down) / 2;
    segment.first_round_trip = up - down;
    for (std::size_t i = first; i < last; ++i) segment.steps.push_back({sites[i], 0, 0, 0, {}, {}});
    std::stable_sort(segment.steps.begin(), segment.steps.end(), earlier);
    segment.begin = segment.steps.front().site.sample.at;
    segment.end = segment.steps.back().site.sample.at;
    return segment;
}

double Smoother::level_ns(const Segment& segment, const SmootherStep& step) {
    return static_cast<double>(step.site.direction) *
           static_cast<double>((step.site.sample.host_minus_board - segment.base).ns);
}

/// What a message adds to a state that does not include it yet.
void Smoother::judge(SmootherStep& step, double level_ns, double mean, double variance,
                     double share) {
    const double deviation = std::sqrt(variance + square(edge_blur(step.site.scale_ns)));
    const Influence influence = influence_of(level_ns - mean, deviation, step.site.scale_ns);
    const double precision = influence.curvature / (1 - variance * influence.curvature);
    const double precision_mean = precision * mean + influence.score * (1 + variance * precision);
    step.precision += share * (precision - step.precision);
    step.precision_mean += share * (precision_mean - step.precision_mean);
}

void Smoother::pass_forth(Segment& segment, bool first) {
    GaussianState state =
        GaussianState::after_exchange(static_cast<double>(segment.first_round_trip.ns));
    BoardTime at = segment.steps.front().site.sample.at;
    for (SmootherStep& step : segment.steps) {
        state = state.after(step.site.sample.at - at);
        at = step.site.sample.at;
        const StateVector direction = level_now(step.site.direction);
        const StateVector gain = matrix(state) * direction;
        const double variance = direction.dot(gain);
        const double mean = direction.dot(vector(state));
        if (first) judge(step, level_ns(segment, step), mean, variance, 1);
        const double scale = 1 / (1 + step.precision * variance);
        vector(state) += gain * scale * (step.precision_mean - step.precision * mean);
        matrix(state) -= step.precision * scale * gain * gain.transpose();
        step.filtered = state;
    }
}

void Smoother::pass_back(Segment& segment) {
    std::vector<SmootherStep>& steps = segment.steps;
    steps.back().smoothed = steps.back().filtered;
    for (std::size_t i = steps.size() - 1; i-- > 0;) {
        const GaussianState& filtered = steps[i].filtered;
        const Duration span = steps[i + 1].site.sample.at - steps[i].site.sample.at;
        const GaussianState predicted = filtered.after(span);
        const StateMatrix back =
            matrix(predicted).ldlt().solve(transition(span) * matrix(filtered)).transpose();
        const GaussianState& later = steps[i + 1].smoothed;
        GaussianState& smoothed = steps[i].smoothed;
        vector(smoothed) = vector(filtered) + back * (vector(later) - vector(predicted));
        matrix(smoothed) =
            matrix(filtered) + back * (matrix(later) - matrix(predicted)) * back.transpose();
    }
}

/// The filter's first slots were short, as it knew no skew yet: of theirs, too, only the shortest
/// delays of each two seconds count, lest they be judged by those of longer slots.
void Smoother::thin(Segment& segment) {
    std::vector<SmootherStep> kept;
    std::optional<std::size_t> shortest[2];
    BoardTime window = segment.steps.front().site.sample.at;
    const BoardTime end = window + short_slots;
    const auto delay = [&](const SmootherStep& step) {
        return level_ns(segment, step) -
               static_cast<double>(step.site.direction) * step.smoothed.mean[0];
    };
    for (const SmootherStep& step : segment.steps) {
        const BoardTime at = step.site.sample.at;
        if (at - window >= slot || at >= end) {
            shortest[0] = shortest[1] = std::nullopt;
            window = at;
        }
        std::optional<std::size_t>& rival =
            shortest[step.site.direction == Direction::to_host ? 0 : 1];
        if (!rival) {
            rival = kept.size();
            kept.push_back(step);
        } else if (delay(step) < delay(kept[*rival])) {
            kept[*rival] = step;
        }
    }
    std::stable_sort(kept.begin(), kept.end(), earlier);
    segment.steps = std::move(kept);
}

/// How the delays around each message spread, before and after it.
void Smoother::rescale(Segment& segment, Direction direction) {
    std::vector<SmootherStep*> steps;
    std::vector<double> delays;
    for (SmootherStep& step : segment.steps) {
        if (step.site.direction != direction) continue;
        steps.push_back(&step);
        const double offset = static_cast<double>(direction) * step.smoothed.mean[0];
        delays.push_back(level_ns(segment, step) - offset);
    }
    std::vector<double> around;
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const std::size_t first = i < neighbours ? 0 : i - neighbours;
        const std::size_t last = std::min(i + neighbours + 1, delays.size());
        around.assign(delays.begin() + static_cast<std::ptrdiff_t>(first),
                      delays.begin() + static_cast<std::ptrdiff_t>(last));
        EdgeSite& site = steps[i]->site;
        site.scale_ns = delay_scale(around).value_or(site.scale_ns);
    }
}

/// Judges each message again, against all the others.
void Smoother::weigh(Segment& segment) {
    for (SmootherStep& step : segment.steps) {
        const StateVector direction = level_now(step.site.direction);
        const double precision = 1 / direction.dot(matrix(step.smoothed) * direction);
        const double others = precision - step.precision;
        if (others <= least_of_others * precision) continue;  // all that is known comes from it
        const double mean =
            (precision * direction.dot(vector(step.smoothed)) - step.precision_mean) / others;
        judge(step, level_ns(segment, step), mean, 1 / others, damping);
    }
}

/// By how much shortest delays exceed the shortest possible one, around each of them.
std::vector<double> Smoother::overshoots(const std::vector<double>& delays_ns) {
    std::vector<double> result;
    DelayShape shape;
    std::vector<double> sorted;
    for (std::size_t end = remembered_slots; end <= delays_ns.size(); ++end) {
        const auto last = delays_ns.begin() + static_cast<std::ptrdiff_t>(end);
        sorted.assign(last - static_cast<std::ptrdiff_t>(remembered_slots), last);
        std::sort(sorted.begin(), sorted.end());
        shape.add(sorted);
        result.push_back(shape.overshoot_ns());
    }
    if (result.empty()) return std::vector<double>(delays_ns.size());
    // The average of those before an instant is that around an earlier one.
    std::vector<double> around;
    for (std::size_t i = 0; i < delays_ns.size(); ++i)
        around.push_back(result[std::min(i + later_windows, result.size() - 1)]);
    return around;
}

/// As in the filter, half of the difference of the two overshoots is no time of the board.
void Smoother::presume_asymmetry(Segment& segment) {
    std::vector<double> delays[2];
    const auto index = [](const SmootherStep& step) {
        return step.site.direction == Direction::to_host ? 0 : 1;
    };
    for (const SmootherStep& step : segment.steps)
        delays[index(step)].push_back(level_ns(segment, step) -
                                      static_cast<double>(step.site.direction) *
                                          step.smoothed.mean[0]);
    const std::vector<double> found[2] = {overshoots(delays[0]), overshoots(delays[1])};
    std::size_t next[2] = {0, 0};
    double now[2] = {found[0].empty() ? 0 : found[0].front(),
                     found[1].empty() ? 0 : found[1].front()};
    for (SmootherStep& step : segment.steps) {
        const int direction = index(step);
        now[direction] = found[direction][next[direction]++];
        step.presumed_asymmetry_ns = (now[0] - now[1]) / 2;
    }
}

const Smoother::Segment* Smoother::segment_of(BoardTime board) const {
    const Segment* begun = nullptr;
    for (const Segment& segment : segments_)
        if (segment.begin <= board &&
            (begun == nullptr || board <= segment.end || begun->end < board))
            begun = &segment;
    return begun != nullptr || segments_.empty() ? begun : &segments_.front();
}

HostEstimate Smoother::translate(BoardTime board) const {
    HostEstimate estimate;
    const Segment* segment = segment_of(board);
    if (segment == nullptr) return estimate;
    const std::vector<SmootherStep>& steps = segment->steps;
    const auto after = std::upper_bound(
        steps.begin(), steps.end(), board,
        [](BoardTime at, const SmootherStep& step) { return at < step.site.sample.at; });
    const SmootherStep& next = after == steps.end() ? steps.back() : *after;
    const SmootherStep& last = after == steps.begin() ? steps.front() : *(after - 1);
    const Duration since_last = board - last.site.sample.at;
    const Duration since_next = board - next.site.sample.at;
    const double last_variance = last.smoothed.offset_variance_after(since_last);
    const double next_variance = next.smoothed.offset_variance_after(since_next);
    const double share = last_variance / (last_variance + next_variance);
    const double offset = last.smoothed.offset_after(since_last) * (1 - share) +
                          next.smoothed.offset_after(since_next) * share;
    const double variance = std::min(last_variance, next_variance);
    const double shortest = next.smoothed.mean[3];
    const double presumed = next.presumed_asymmetry_ns;
    const Duration asymmetry =
        asymmetry_ ? asymmetry_->offset : rounded(overshoot_share * presumed);
    const double doubt = std::abs(overshoot_doubt * presumed);
    estimate.time = HostTime{board.ns} + segment->base + rounded(offset) - asymmetry;
    estimate.sigma = rounded(std::sqrt(variance + asymmetry_variance(asymmetry_, shortest, doubt)));
    estimate.bound =
        rounded(std::max(shortest, 0.0) + bound_sigmas * std::sqrt(variance)) + absolute(asymmetry);
    const bool within =
        segment->begin - longest_silence <= board && board <= segment->end + longest_silence;
    estimate.state = within ? ClockState::locked : ClockState::holdover;
    if (board > segment->end && segment != &segments_.back()) estimate.state = ClockState::step;
    return estimate;
}

}  // namespace versavis::clock
