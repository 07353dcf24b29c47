// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/smoother.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "engine/clock/belief_matrix.hpp"
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

double square(double x) { return x * x; }

BeliefVector level_now(Direction direction) {
    return level_by_component(static_cast<double>(direction), {});
}

}  // namespace

bool Smoother::earlier(const Knot& a, const Knot& b) {
    return a.site.passage.at < b.site.passage.at;
}

Smoother::Smoother(const std::vector<Message>& messages) {
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
    }
}

/// The first two sites are the filter's first exchange.
Smoother::Segment Smoother::begin(const std::vector<EdgeSite>& sites, std::size_t first,
                                  std::size_t last) {
    Segment segment;
    const Duration down = sites[first].passage.host_minus_board;
    const Duration up = sites[first + 1].passage.host_minus_board;
    segment.base = down + (up - down) / 2;
    segment.first_round_trip = up - down;
    for (std::size_t i = first; i < last; ++i) segment.knots.push_back({sites[i], 0, 0, {}, {}});
    std::stable_sort(segment.knots.begin(), segment.knots.end(), earlier);
    segment.begin = segment.knots.front().site.passage.at;
    segment.end = segment.knots.back().site.passage.at;
    return segment;
}

double Smoother::level_ns(const Segment& segment, const Knot& knot) {
    return static_cast<double>(knot.site.direction) *
           static_cast<double>((knot.site.passage.host_minus_board - segment.base).ns);
}

/// What a message adds to a belief of its level that does not hold it yet.
void Smoother::judge(Knot& knot, double level_ns, double mean, double variance, double share) {
    const double deviation = std::sqrt(variance + square(edge_blur(knot.site.scale_ns)));
    const Influence influence = influence_of(level_ns - mean, deviation, knot.site.scale_ns);
    const double precision = influence.curvature / (1 - variance * influence.curvature);
    const double precision_mean = precision * mean + influence.score * (1 + variance * precision);
    knot.precision += share * (precision - knot.precision);
    knot.precision_mean += share * (precision_mean - knot.precision_mean);
}

void Smoother::pass_forth(Segment& segment, bool first) {
    Belief belief = Belief::after_exchange(static_cast<double>(segment.first_round_trip.ns));
    BoardTime at = segment.knots.front().site.passage.at;
    for (Knot& knot : segment.knots) {
        belief = belief.after(knot.site.passage.at - at);
        at = knot.site.passage.at;
        const BeliefVector direction = level_now(knot.site.direction);
        const BeliefVector gain = matrix(belief) * direction;
        const double variance = direction.dot(gain);
        const double mean = direction.dot(vector(belief));
        if (first) judge(knot, level_ns(segment, knot), mean, variance, 1);
        const double scale = 1 / (1 + knot.precision * variance);
        vector(belief) += gain * scale * (knot.precision_mean - knot.precision * mean);
        matrix(belief) -= knot.precision * scale * gain * gain.transpose();
        knot.filtered = belief;
    }
}

void Smoother::pass_back(Segment& segment) {
    std::vector<Knot>& knots = segment.knots;
    knots.back().smoothed = knots.back().filtered;
    for (std::size_t i = knots.size() - 1; i-- > 0;) {
        const Belief& filtered = knots[i].filtered;
        const Duration span = knots[i + 1].site.passage.at - knots[i].site.passage.at;
        const Belief predicted = filtered.after(span);
        const BeliefMatrix back =
            matrix(predicted).ldlt().solve(transition(span) * matrix(filtered)).transpose();
        const Belief& later = knots[i + 1].smoothed;
        Belief& smoothed = knots[i].smoothed;
        vector(smoothed) = vector(filtered) + back * (vector(later) - vector(predicted));
        matrix(smoothed) =
            matrix(filtered) + back * (matrix(later) - matrix(predicted)) * back.transpose();
    }
}

/// The filter's first slots were short, as it knew no skew yet: of theirs, too, only the shortest
/// delays of each two seconds count, lest they be judged by those of longer slots.
void Smoother::thin(Segment& segment) {
    std::vector<Knot> kept;
    std::optional<std::size_t> shortest[2];
    BoardTime window = segment.knots.front().site.passage.at;
    const BoardTime end = window + short_slots;
    const auto delay = [&](const Knot& knot) {
        return level_ns(segment, knot) -
               static_cast<double>(knot.site.direction) * knot.smoothed.mean[0];
    };
    for (const Knot& knot : segment.knots) {
        const BoardTime at = knot.site.passage.at;
        if (at - window >= slot || at >= end) {
            shortest[0] = shortest[1] = std::nullopt;
            window = at;
        }
        std::optional<std::size_t>& rival =
            shortest[knot.site.direction == Direction::to_host ? 0 : 1];
        if (!rival) {
            rival = kept.size();
            kept.push_back(knot);
        } else if (delay(knot) < delay(kept[*rival])) {
            kept[*rival] = knot;
        }
    }
    std::stable_sort(kept.begin(), kept.end(), earlier);
    segment.knots = std::move(kept);
}

/// How the delays around each message spread, before and after it.
void Smoother::rescale(Segment& segment, Direction direction) {
    std::vector<Knot*> knots;
    std::vector<double> delays;
    for (Knot& knot : segment.knots) {
        if (knot.site.direction != direction) continue;
        knots.push_back(&knot);
        const double offset = static_cast<double>(direction) * knot.smoothed.mean[0];
        delays.push_back(level_ns(segment, knot) - offset);
    }
    std::vector<double> around;
    for (std::size_t i = 0; i < knots.size(); ++i) {
        const std::size_t first = i < neighbours ? 0 : i - neighbours;
        const std::size_t last = std::min(i + neighbours + 1, delays.size());
        around.assign(delays.begin() + static_cast<std::ptrdiff_t>(first),
                      delays.begin() + static_cast<std::ptrdiff_t>(last));
        EdgeSite& site = knots[i]->site;
        site.scale_ns = delay_scale(around).value_or(site.scale_ns);
    }
}

/// Each message anew, against what all others say.
void Smoother::weigh(Segment& segment) {
    for (Knot& knot : segment.knots) {
        const BeliefVector direction = level_now(knot.site.direction);
        const double precision = 1 / direction.dot(matrix(knot.smoothed) * direction);
        const double others = precision - knot.precision;
        if (others <= least_of_others * precision) continue;  // all that is known comes from it
        const double mean =
            (precision * direction.dot(vector(knot.smoothed)) - knot.precision_mean) / others;
        judge(knot, level_ns(segment, knot), mean, 1 / others, damping);
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
    const std::vector<Knot>& knots = segment->knots;
    const auto after =
        std::upper_bound(knots.begin(), knots.end(), board,
                         [](BoardTime at, const Knot& knot) { return at < knot.site.passage.at; });
    const Knot& next = after == knots.end() ? knots.back() : *after;
    const Knot& last = after == knots.begin() ? knots.front() : *(after - 1);
    const Duration since_last = board - last.site.passage.at;
    const Duration since_next = board - next.site.passage.at;
    const double last_variance = last.smoothed.offset_variance_after(since_last);
    const double next_variance = next.smoothed.offset_variance_after(since_next);
    const double share = last_variance / (last_variance + next_variance);
    const double offset = last.smoothed.offset_after(since_last) * (1 - share) +
                          next.smoothed.offset_after(since_next) * share;
    const double variance = std::min(last_variance, next_variance);
    const double shortest = next.smoothed.mean[3];
    estimate.time = HostTime{board.ns} + segment->base + rounded(offset);
    estimate.sigma = rounded(std::sqrt(variance + asymmetry_variance(std::nullopt, shortest)));
    estimate.bound = rounded(std::max(shortest, 0.0) + bound_sigmas * std::sqrt(variance));
    const bool within =
        segment->begin - longest_silence <= board && board <= segment->end + longest_silence;
    estimate.state = within ? ClockState::locked : ClockState::holdover;
    return estimate;
}

}  // namespace versavis::clock
