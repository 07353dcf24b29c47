// SPDX-License-Identifier: BSD-3-Clause
#include "gnss/mark_match.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace versavis::client {

namespace {

/// How far a mark may be from its frame, less what their clocks were apart at the pair before: a
/// pulse lies where the middle of the exposure was planned, and clocks drift between two frames.
constexpr Duration largest_distance = milliseconds(2);

/// Of the usual gap: the next frame is never as near.
constexpr std::int64_t gap_parts = 4;

/// Marks that are compared for their gaps. If lower, chance fits; if higher, one that is lost
/// matters less, but a short recording has too few.
constexpr std::size_t stretch = 40;

/// Of these, one is no glitch.
constexpr std::size_t tried_marks = 3;

/// Gaps are uneven where a camera starts, and where marks are lost.
constexpr std::size_t tried_stretches = 8;

/// Of the number of what is lost at random.
constexpr double clear_sigmas = 4;

/// Two crystals drift apart by up to 200 ppm.
constexpr std::int64_t drift_parts = 5'000;

/// So many more of a stretch must fit in one place than in any other.
constexpr int clearly_more = 4;

/// Of a stretch that is believed, and of all frames between first and last mark.
constexpr double least_share = 0.75;

/// Of the distance of a pair, in the estimate of how far the clocks are apart: its noise is that of
/// a stamp, and two crystals drift by up to 100 us in a second.
constexpr std::int64_t follow_parts = 4;

Duration distance(Duration mark, OutputTime frame, Duration offset) {
    return mark - Duration{frame.ns} - offset;
}

/// Two instants of one kind may be close when one of them is a glitch: the median counts.
Duration usual_gap(std::span<const MarkableFrame> frames) {
    std::vector<std::int64_t> gaps;
    for (std::size_t i = 1; i < frames.size(); ++i)
        gaps.push_back((frames[i].time - frames[i - 1].time).ns);
    if (gaps.empty()) return largest_distance * gap_parts;
    const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
    std::nth_element(gaps.begin(), middle, gaps.end());
    return Duration{*middle};
}

/// One that was sent, by the trigger numbers of frames; `frame` of those that are there.
struct Pulse {
    OutputTime time;
    std::optional<std::size_t> frame;
};

/// Where marks may lie.
struct Place {
    OutputTime at;
    Duration offset;
    int score = 0;  ///< of a stretch
};

/// All marks at one place, pairs of a pulse and a mark.
struct Fit {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    std::int64_t misfits = 0;  ///< pulses and marks without the other, where there are both
};

class Matching {
 public:
    Matching(std::span<const MarkableFrame> frames, std::span<const Duration> marks)
        : marks_(marks),
          usual_gap_(usual_gap(frames)),
          reach_(std::min(largest_distance, usual_gap_ / gap_parts)),
          pulses_(all_pulses(frames)) {}

    Expected<MarkMatch> by_pattern() const {
        const UnevenPlaces found = uneven_places();
        if (found.places.empty() && found.best < least_share * static_cast<double>(found.count))
            return failure(
                fmt::format("{} of {} marks with uneven gaps fit pulses", found.best, found.count),
                "is this the file of the receiver that got this camera's pulses, of the same "
                "drive? See docs/user/gnss.md");
        if (found.places.empty())
            return failure(
                "the gaps fit in several ways: any frame could have any mark",
                "record the receiver's sentences as well (nmea = true in [ports]), or let the "
                "receiver run before the cameras start, which they do with uneven gaps");
        const auto place = best_of(found.places);
        if (!place) return Unexpected(place.error());
        return result(MatchProof::pattern, fit(*place));
    }

    Expected<MarkMatch> by_relation(std::span<const ClockRelation> relation) const {
        for (const Pulse& pulse : pulses_) {
            const Duration offset = offset_at(relation, pulse.time);
            const std::size_t mark = nearest(pulse.time, offset);
            if (absolute(distance(marks_[mark], pulse.time, offset)) > reach_) continue;
            const Fit found = fit({pulse.time, offset});
            // Even gaps fit at any second, a start of the camera does not.
            const auto same = [&, place = Place{pulse.time, offset}](const Place& one) {
                return is_same(one, place);
            };
            const auto uneven = uneven_places().places;
            if (!uneven.empty() && std::none_of(uneven.begin(), uneven.end(), same))
                return failure(
                    fmt::format("the receiver's seconds and the uneven gaps of its marks differ by "
                                "{:.3f} s",
                                static_cast<double>((offset - uneven[0].offset).ns) / 1e9),
                    "is --leap-seconds right?");
            return result(MatchProof::labels, found);
        }
        return failure(
            "no mark lies where a frame was exposed, by the seconds that the receiver named",
            "is this the file of the same drive and receiver? If its marks are in GPS time, is "
            "--leap-seconds right?");
    }

 private:
    /// Also those whose frames are missing, by the trigger numbers: else a wrong place where by
    /// chance marks and frames are missing together would fit better than the right one.
    std::vector<Pulse> all_pulses(std::span<const MarkableFrame> frames) const {
        std::vector<Pulse> pulses;
        for (std::size_t i = 0; i < frames.size(); ++i) {
            if (i > 0) {
                const Duration gap = frames[i].time - frames[i - 1].time;
                const auto steps =
                    static_cast<std::int64_t>(frames[i].trigger - frames[i - 1].trigger);
                // Gaps that are not even have another number of pulses than of periods.
                if (steps > 1 && absolute(gap / steps - usual_gap_) < usual_gap_ / gap_parts)
                    for (std::int64_t k = 1; k < steps; ++k)
                        pulses.push_back({frames[i - 1].time + gap / steps * k, {}});
            }
            pulses.push_back({frames[i].time, i});
        }
        return pulses;
    }

    /// Gives each pulse the nearest mark in reach, from one on in one direction.
    void follow(std::size_t pulse, Duration offset, bool forward, Fit& fit) const {
        const std::size_t first = fit.pairs.size();
        for (; pulse < pulses_.size(); pulse = forward ? pulse + 1 : pulse - 1) {
            const std::size_t mark = nearest(pulses_[pulse].time, offset);
            const Duration off = distance(marks_[mark], pulses_[pulse].time, offset);
            const bool taken = fit.pairs.size() > first && fit.pairs.back().second == mark;
            if (absolute(off) > reach_ || taken) continue;
            fit.pairs.emplace_back(pulse, mark);
            offset = offset + off / follow_parts;
        }
    }

    Fit fit(const Place& place) const {
        const auto at = pulse_at(place.at);
        Fit found;
        // Before the first lies no other: the count goes beyond the last.
        follow(at - 1, place.offset, false, found);
        std::reverse(found.pairs.begin(), found.pairs.end());
        follow(at, place.offset, true, found);
        if (found.pairs.empty()) {
            found.misfits = static_cast<std::int64_t>(pulses_.size() + marks_.size());
            return found;
        }
        const auto offset_of = [&](const auto& pair) {
            return marks_[pair.second] - Duration{pulses_[pair.first].time.ns};
        };
        const Duration first = offset_of(found.pairs.front());
        const Duration last = offset_of(found.pairs.back());
        const std::size_t pulses = pulse_at({(marks_.back() - last + reach_).ns}) -
                                   pulse_at({(marks_.front() - first - reach_).ns});
        const std::size_t marks = mark_at(Duration{pulses_.back().time.ns} + last + reach_) -
                                  mark_at(Duration{pulses_.front().time.ns} + first - reach_);
        found.misfits = static_cast<std::int64_t>(pulses + marks) -
                        2 * static_cast<std::int64_t>(found.pairs.size());
        return found;
    }

    bool is_same(const Place& a, const Place& b) const {
        const Duration drift = absolute(a.at - b.at) / drift_parts;
        return absolute(a.offset - b.offset) <= usual_gap_ / 2 + drift;
    }

    struct UnevenPlaces {
        std::vector<Place> places;  ///< where a stretch of uneven gaps fits, and nowhere else
        std::size_t count = 0;      ///< of marks in a stretch
        int best = 0;               ///< of those, how many fit anywhere
    };

    UnevenPlaces uneven_places() const {
        UnevenPlaces found;
        found.count = std::min({stretch, marks_.size(), pulses_.size()});
        for (const std::size_t first : uneven_stretches(found.count)) {
            const auto [place, second] = best_place(first, found.count);
            found.best = std::max(found.best, place.score);
            const bool fits = place.score >= least_share * static_cast<double>(found.count) &&
                              place.score >= second + clearly_more;
            const auto known = [&, at = place](const Place& one) { return is_same(one, at); };
            if (fits && std::none_of(found.places.begin(), found.places.end(), known))
                found.places.push_back(place);
        }
        return found;
    }

    /// A camera starts with the same gaps each time: of several places one must fit clearly better.
    Expected<Place> best_of(const std::vector<Place>& places) const {
        std::vector<std::pair<Fit, Place>> fits;
        for (const Place& place : places) fits.emplace_back(fit(place), place);
        const auto better = [](const auto& a, const auto& b) {
            return a.first.misfits * static_cast<std::int64_t>(b.first.pairs.size()) <
                   b.first.misfits * static_cast<std::int64_t>(a.first.pairs.size());
        };
        std::sort(fits.begin(), fits.end(), better);
        for (std::size_t i = 1; i < fits.size(); ++i)
            if (!is_clearly_worse(fits[i].first, fits[0].first))
                return failure(
                    "the camera started more than once, and its marks fit several starts",
                    "give the receiver's log of this drive alone, or record the "
                    "receiver's sentences as well (nmea = true in [ports])");
        return fits[0].second;
    }

    /// By more misfits than what is lost at random explains.
    static bool is_clearly_worse(const Fit& fit, const Fit& best) {
        const auto length = [](const Fit& of) { return static_cast<double>(of.pairs.size() + 1); };
        const double expected = static_cast<double>(best.misfits) * length(fit) / length(best);
        return static_cast<double>(fit.misfits) >
               expected + clear_sigmas * std::sqrt(expected + 1) + clearly_more;
    }

    Expected<MarkMatch> result(MatchProof proof, const Fit& fit) const {
        MarkMatch match{proof};
        for (const auto& [pulse, mark] : fit.pairs)
            if (pulses_[pulse].frame) match.pairs.push_back({*pulses_[pulse].frame, mark});
        const std::size_t between = fit.pairs.back().first - fit.pairs.front().first + 1;
        if (static_cast<double>(fit.pairs.size()) < least_share * static_cast<double>(between))
            return failure(fmt::format("only {} of {} exposures between the first mark and the "
                                       "last have one",
                                       fit.pairs.size(), between),
                           "u-blox reports one mark per measurement: set its rate to that of the "
                           "camera or above");
        return match;
    }

    /// Of a stretch of marks: the pulses that have one, less those between them that have none.
    int score(std::size_t first, std::size_t count, Duration offset) const {
        const Duration begin = marks_[first] - offset - reach_;
        const Duration end = marks_[first + count - 1] - offset + reach_;
        int found = 0;
        std::size_t mark = first;
        for (std::size_t i = pulse_at({begin.ns}); i < pulses_.size(); ++i) {
            const OutputTime pulse = pulses_[i].time;
            if (pulse > OutputTime{end.ns}) break;
            while (mark + 1 < first + count && distance(marks_[mark], pulse, offset) < -reach_)
                ++mark;
            const Duration off = distance(marks_[mark], pulse, offset);
            const bool fits = absolute(off) <= reach_;
            if (fits) offset = offset + off / follow_parts;
            found += fits ? 1 : -1;
        }
        return found;
    }

    /// Where a stretch of marks fits best, and how well in the best other place.
    std::pair<Place, int> best_place(std::size_t first, std::size_t count) const {
        std::vector<Place> places;
        // Not by the first mark alone: it may be a glitch.
        for (std::size_t mark = first; mark < first + std::min(count, tried_marks); ++mark)
            for (const Pulse& pulse : pulses_) {
                const Duration offset = marks_[mark] - Duration{pulse.time.ns};
                places.push_back({pulse.time, offset, score(first, count, offset)});
            }
        const auto less = [](const Place& a, const Place& b) { return a.score < b.score; };
        const Place found = *std::max_element(places.begin(), places.end(), less);
        int second = 0;
        for (const Place& place : places)
            if (absolute(place.offset - found.offset) > usual_gap_ / 2)
                second = std::max(second, place.score);
        return {found, second};
    }

    /// First marks of the stretches whose gaps differ most, by their mean square over their mean.
    std::vector<std::size_t> uneven_stretches(std::size_t count) const {
        std::vector<std::pair<double, std::size_t>> all;
        for (std::size_t first = 0; first + count <= marks_.size();
             first += std::max<std::size_t>(1, count / 4)) {
            double sum = 0;
            double squares = 0;
            for (std::size_t i = first + 1; i < first + count; ++i) {
                const auto gap = static_cast<double>((marks_[i] - marks_[i - 1]).ns);
                sum += gap;
                squares += gap * gap;
            }
            all.emplace_back(sum > 0 ? squares * static_cast<double>(count - 1) / (sum * sum) : 0,
                             first);
        }
        std::sort(all.rbegin(), all.rend());
        std::vector<std::size_t> firsts;
        for (std::size_t i = 0; i < std::min(all.size(), tried_stretches); ++i)
            firsts.push_back(all[i].second);
        return firsts;
    }

    std::size_t pulse_at(OutputTime time) const {
        const auto at = std::lower_bound(pulses_.begin(), pulses_.end(), time,
                                         [](const Pulse& p, OutputTime t) { return p.time < t; });
        return static_cast<std::size_t>(at - pulses_.begin());
    }

    std::size_t mark_at(Duration time) const {
        return static_cast<std::size_t>(std::lower_bound(marks_.begin(), marks_.end(), time) -
                                        marks_.begin());
    }

    static Duration offset_at(std::span<const ClockRelation> relation, OutputTime time) {
        const auto after =
            std::lower_bound(relation.begin(), relation.end(), time,
                             [](const ClockRelation& r, OutputTime t) { return r.at < t; });
        return after == relation.end() ? relation.back().offset : after->offset;
    }

    /// There is a mark.
    std::size_t nearest(OutputTime pulse, Duration offset) const {
        const Duration expected = Duration{pulse.ns} + offset;
        const std::size_t after = mark_at(expected);
        if (after == 0) return 0;
        const bool before =
            after == marks_.size() || expected - marks_[after - 1] < marks_[after] - expected;
        return before ? after - 1 : after;
    }

    std::span<const Duration> marks_;
    Duration usual_gap_;
    Duration reach_;
    std::vector<Pulse> pulses_;
};

}  // namespace

const char* to_string(MatchProof proof) {
    switch (proof) {
        case MatchProof::none: return "none";
        case MatchProof::labels: return "labels";
        case MatchProof::pattern: return "pattern";
    }
    return "unknown";
}

Expected<MarkMatch> match_marks(std::span<const MarkableFrame> frames,
                                std::span<const Duration> marks,
                                std::span<const ClockRelation> relation) {
    if (frames.empty()) return failure("there are no frames with a proved stamp", "");
    if (marks.empty()) return failure("there are no marks", "");
    const Matching matching(frames, marks);
    return relation.empty() ? matching.by_pattern() : matching.by_relation(relation);
}

}  // namespace versavis::client
