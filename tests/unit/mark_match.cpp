// SPDX-License-Identifier: BSD-3-Clause
#include "gnss/mark_match.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <random>
#include <vector>

using namespace versavis;
using namespace versavis::client;

namespace {

constexpr std::int64_t period_ns = 50'000'000;
/// Gaps of the board's start pattern, in ticks.
constexpr int start_gaps[] = {1, 2, 1, 3, 2, 2, 3, 3, 1, 1};

/// A drive, and what is left of it on both sides.
struct Drive {
    std::vector<std::int64_t> ticks;       ///< of each exposure
    std::vector<std::size_t> frame_ticks;  ///< which exposure each frame is of
    std::vector<std::size_t> mark_ticks;   ///< and each mark; `none`: of none
    std::vector<MarkableFrame> frames;
    std::vector<Duration> marks;
    std::vector<ClockRelation> labels;

    static constexpr std::size_t none = SIZE_MAX;
};

struct Conditions {
    std::size_t exposures = 600;
    bool start_pattern = true;
    double lost_frames = 0;
    double lost_marks = 0;
    double glitches = 0;  ///< of exposures, an edge more
    double drift_ppm = 0;
    std::int64_t noise_ns = 3'000;
    std::int64_t offset_ns = 1'234'567'890'123;  ///< receiver's clock less output clock
    std::size_t receiver_from = 0;               ///< the first exposure that it sees
    std::uint32_t seed = 1;
};

Drive drive(const Conditions& with) {
    std::mt19937 random(with.seed);
    const auto chance = [&](double p) { return std::bernoulli_distribution(p)(random); };
    const auto noise = [&] {
        return std::uniform_int_distribution<std::int64_t>(-with.noise_ns, with.noise_ns)(random);
    };
    Drive made;
    std::int64_t tick = 1000;
    const auto on_receiver = [&](std::int64_t ns) {
        return with.offset_ns + ns +
               static_cast<std::int64_t>(with.drift_ppm * 1e-6 * static_cast<double>(ns));
    };
    for (std::size_t i = 0; i < with.exposures; ++i) {
        const std::int64_t at = tick * period_ns;
        if (!chance(with.lost_frames)) {
            made.frame_ticks.push_back(i);
            made.frames.push_back({{at + noise()}, 7 + i});
        }
        if (i >= with.receiver_from && !chance(with.lost_marks)) {
            made.mark_ticks.push_back(i);
            made.marks.push_back({on_receiver(at) + noise()});
        }
        if (i >= with.receiver_from && chance(with.glitches)) {
            made.mark_ticks.push_back(Drive::none);
            made.marks.push_back({on_receiver(at) + period_ns / 3});
        }
        if (i % 20 == 0) made.labels.push_back({{at}, Duration{on_receiver(at) - at}});
        tick += with.start_pattern && i < std::size(start_gaps) ? start_gaps[i] : 1;
    }
    return made;
}

/// Right pairs; none may be wrong.
std::size_t right_pairs(const Drive& drive, const Expected<MarkMatch>& match) {
    if (!match) UNSCOPED_INFO(match.error().message());
    REQUIRE(match);
    for (const MatchedMark& pair : match->pairs)
        REQUIRE(drive.frame_ticks.at(pair.frame) == drive.mark_ticks.at(pair.mark));
    return match->pairs.size();
}

/// Exposures with a frame and a mark.
std::size_t both(const Drive& drive) {
    std::size_t count = 0;
    for (const std::size_t mark : drive.mark_ticks)
        count += std::binary_search(drive.frame_ticks.begin(), drive.frame_ticks.end(), mark);
    return count;
}

}  // namespace

TEST_CASE("mark_match: the start pattern fits in one way, whatever is lost, and drifting clocks") {
    for (const double lost : {0.0, 0.01, 0.05}) {
        int matched = 0;
        for (std::uint32_t seed = 1; seed <= 20; ++seed)
            for (const double drift_ppm : {0.0, 30.0, -90.0}) {
                Conditions with;
                with.lost_frames = with.lost_marks = lost;
                with.glitches = lost / 5;
                with.drift_ppm = drift_ppm;
                with.seed = seed;
                const Drive made = drive(with);
                const auto match = match_marks(made.frames, made.marks, {});
                if (!match) continue;  // too much of the pattern is lost
                CAPTURE(seed, lost, drift_ppm);
                CHECK(right_pairs(made, match) == both(made));
                CHECK(match->proof == MatchProof::pattern);
                ++matched;
            }
        CHECK(matched >= (lost < 0.05 ? 60 : 50));
    }
}

TEST_CASE("mark_match: even gaps fit in many ways, which is refused, whatever is lost") {
    for (std::uint32_t seed = 1; seed <= 10; ++seed)
        for (const double lost : {0.0, 0.02, 0.1, 0.3}) {
            Conditions with;
            with.start_pattern = false;
            with.lost_frames = with.lost_marks = lost;
            with.exposures = 1500;
            with.seed = seed;
            const Drive made = drive(with);
            CAPTURE(seed, lost);
            CHECK_FALSE(match_marks(made.frames, made.marks, {}));
        }
}

TEST_CASE("mark_match: a receiver that missed the start is no excuse for a guess") {
    Conditions with;
    with.receiver_from = 30;
    const Drive made = drive(with);
    CHECK_FALSE(match_marks(made.frames, made.marks, {}));
    CHECK(right_pairs(made, match_marks(made.frames, made.marks, made.labels)) == 570);
}

TEST_CASE("mark_match: seconds that the receiver named tell even gaps apart, over hours of drift") {
    Conditions with;
    with.start_pattern = false;
    with.exposures = 20'000;
    with.lost_frames = with.lost_marks = 0.01;
    with.drift_ppm = 40;
    const Drive made = drive(with);
    const auto match = match_marks(made.frames, made.marks, made.labels);
    CHECK(right_pairs(made, match) == both(made));
    CHECK(match->proof == MatchProof::labels);
}

TEST_CASE("mark_match: a wrong leap second is found by the uneven gaps, or else fits nothing") {
    Conditions with;
    for (const bool pattern : {true, false}) {
        with.start_pattern = pattern;
        Drive made = drive(with);
        // By 10 ms: not even near an exposure.
        for (Duration& mark : made.marks) mark = mark + milliseconds(10);
        CHECK_FALSE(match_marks(made.frames, made.marks, made.labels));
    }
    with.start_pattern = true;
    Drive made = drive(with);
    for (Duration& mark : made.marks) mark = mark + seconds(1);
    const auto match = match_marks(made.frames, made.marks, made.labels);
    REQUIRE_FALSE(match);
    CHECK_THAT(match.error().message(), Catch::Contains("differ by -1.000 s"));
}

TEST_CASE("mark_match: of several starts with the same gaps, the right one or none") {
    Conditions with;
    with.exposures = 400;
    const Drive first = drive(with);
    const std::int64_t pause = 30 * 1'000'000'000LL;
    // The receiver saw both starts.
    Drive both_starts = first;
    const std::size_t count = first.marks.size();
    for (std::size_t i = 0; i < count; ++i)
        both_starts.marks.push_back(first.marks[i] + Duration{pause});
    std::vector<MarkableFrame> second = first.frames;
    for (MarkableFrame& frame : second) frame.time = frame.time + Duration{pause};
    const auto all = [&](std::vector<MarkableFrame> frames, std::size_t shift) {
        const auto match = match_marks(frames, both_starts.marks, {});
        REQUIRE(match);
        for (const MatchedMark& pair : match->pairs) REQUIRE(pair.mark == pair.frame + shift);
        CHECK(match->pairs.size() == frames.size());
    };
    // With one start alone nobody can tell.
    CHECK_FALSE(match_marks(second, both_starts.marks, {}));
    CHECK_FALSE(match_marks(first.frames, both_starts.marks, {}));
    // With the pause between them everybody can.
    std::vector<MarkableFrame> both_frames = first.frames;
    both_frames.insert(both_frames.end(), second.begin(), second.end());
    for (std::size_t i = count; i < both_frames.size(); ++i) both_frames[i].trigger += count;
    all(both_frames, 0);
    // Or with a second one that lasted longer than the first.
    const std::int64_t last = second.back().time.ns;
    for (int i = 1; i < 400; ++i) {
        second.push_back({{last + i * period_ns}, second.back().trigger + 1});
        both_starts.marks.push_back(Duration{last + i * period_ns + with.offset_ns});
    }
    all(second, count);
}

TEST_CASE("mark_match: marks of another drive fit nothing, and so do none") {
    Conditions with;
    const Drive one = drive(with);
    std::mt19937 random(7);
    std::vector<Duration> marks;
    std::int64_t at = 0;
    for (int i = 0; i < 600; ++i) {
        at += std::uniform_int_distribution<std::int64_t>(30'000'000, 90'000'000)(random);
        marks.push_back({at});
    }
    CHECK_FALSE(match_marks(one.frames, marks, {}));
    CHECK_FALSE(match_marks(one.frames, {}, {}));
    CHECK_FALSE(match_marks({}, marks, {}));
    CHECK_FALSE(match_marks({}, {}, one.labels));
}

TEST_CASE("mark_match: few frames are no proof by their pattern") {
    for (const std::size_t exposures : {1U, 2U, 3U, 5U}) {
        Conditions with;
        with.exposures = exposures;
        const Drive made = drive(with);
        CHECK_FALSE(match_marks(made.frames, made.marks, {}));
        CHECK(right_pairs(made, match_marks(made.frames, made.marks, made.labels)) == exposures);
    }
}
