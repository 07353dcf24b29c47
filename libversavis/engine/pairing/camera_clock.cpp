// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/camera_clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace versavis::pairing {

namespace {

// Votes in a row that make known which instant is stamped. At half two chance agreements of a noisy
// clock could settle it wrongly; at twice an exposure must change ten times first.
constexpr int votes_to_know = 5;

// Least change of the exposure's length that is asked. At half the jitter of two stamps looks like
// another instant; at twice slow auto exposure says nothing for longer.
constexpr std::int64_t least_change_ns = 250'000;

// ... and in mean deviations of the steadiest relation, for clocks that jitter more. At half such a
// clock votes by chance; at twice only larger changes are asked.
constexpr std::int64_t least_change_deviations = 20;

// ... and per time between the two frames, for clocks that run apart. At half 250 ppm shift a vote
// by a fifth; at twice slow cameras vote at larger changes only.
constexpr double least_change_rate = 2.5e-3;

// How far the stamp may have moved off a vote's share of the change. At half jitter takes votes; at
// twice (0.4) a move in between, which no instant explains, counts as one.
constexpr double vote_tolerance = 0.2;

constexpr Instant instants[] = {Instant::start, Instant::middle, Instant::end};

double share_of_length(Instant instant) {
    return instant == Instant::start ? 0 : instant == Instant::middle ? 0.5 : 1;
}

}  // namespace

const char* to_string(Instant instant) {
    switch (instant) {
        case Instant::unknown: return "unknown";
        case Instant::start: return "start";
        case Instant::middle: return "middle";
        case Instant::end: return "end";
        case Instant::arrival: return "arrival";
    }
    return "unknown";
}

bool seen(const Exposure& exposure, Instant instant) {
    return exposure.kind == StampKind::measured_middle || instant == Instant::start;
}

std::span<const Instant> CameraClock::possible() const {
    if (stamped_ == Instant::unknown) return instants;
    return {std::find(std::begin(instants), std::end(instants), stamped_), 1};
}

Relation& CameraClock::relation(Instant instant) {
    return relations_[static_cast<std::size_t>(instant) - 1];
}

const Relation& CameraClock::relation(Instant instant) const {
    return relations_[static_cast<std::size_t>(instant) - 1];
}

std::int64_t CameraClock::expected_instant_ns(Instant instant, CameraTime time) const {
    return relation(instant).expected_instant_ns(time.ns);
}

std::int64_t CameraClock::tolerance_ns(Instant instant, CameraTime time) const {
    return relation(instant).tolerance_ns(expected_instant_ns(instant, time));
}

void CameraClock::track(CameraTime time, const Record& record) {
    for (const Instant instant : instants)
        if (seen(record.exposure, instant) || !relation(instant).known())
            relation(instant).track(time.ns, record.instant_ns(instant));
    if (seen(record.exposure, Instant::end)) learn({time, record});
}

void CameraClock::move(CameraTime time, const Record& record) {
    last_.reset();
    for (const Instant instant : instants)
        relation(instant).move(time.ns, record.instant_ns(instant));
}

void CameraClock::forget() {
    last_.reset();
    relations_.fill(Relation(true));
}

void CameraClock::learn(const Pair& now) {
    const std::optional<Pair> before = std::exchange(last_, now);
    if (!before || stamped_ != Instant::unknown) return;
    const Duration elapsed = now.record.exposure.start - before->record.exposure.start;
    const std::int64_t moved = (now.time - before->time - elapsed).ns;
    const auto length = [](const Record& record) {
        return (record.end - record.exposure.start).ns;
    };
    const std::int64_t change = length(now.record) - length(before->record);
    const auto steadiest = std::min_element(
        relations_.begin(), relations_.end(),
        [](const auto& a, const auto& b) { return a.deviation_ns() < b.deviation_ns(); });
    if (std::abs(change) < least_change_ns + least_change_deviations * steadiest->deviation_ns() +
                               part_of(elapsed.ns, least_change_rate))
        return;
    const double share = static_cast<double>(moved) / static_cast<double>(change);
    const auto vote = std::find_if(std::begin(instants), std::end(instants), [&](Instant instant) {
        return std::abs(share - share_of_length(instant)) < vote_tolerance;
    });
    const Instant voted = vote == std::end(instants) ? Instant::unknown : *vote;
    votes_ = voted == voted_ && voted != Instant::unknown ? votes_ + 1 : 1;
    voted_ = voted;
    if (voted != Instant::unknown && votes_ == votes_to_know) stamped_ = voted;
}

}  // namespace versavis::pairing
