// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/alignment.hpp"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <set>
#include <utility>
#include <vector>

#include "wire/messages.hpp"

using namespace versavis;
using namespace versavis::pairing;

namespace {

/// Exposures of 2 ms at these ticks of 50 ms, and the frames of some of them.
class AlignmentBench {
 public:
    /// The exposure line stayed silent at the triggers that were `ignored`.
    explicit AlignmentBench(const std::vector<int>& ticks,
                            const std::vector<std::uint64_t>& ignored = {})
        : exposures(Limits{}.period) {
        std::uint64_t trigger = 0;
        for (const int tick : ticks) {
            Exposure exposure;
            exposure.trigger = ++trigger;
            exposure.start = BoardTime{1'000'000'000 + tick * 50'000'000LL};
            exposure.end = exposure.start + milliseconds(2);
            exposure.end_on_host = exposure.earliest_on_host = HostTime{exposure.end.ns};
            exposure.exposed = std::find(ignored.begin(), ignored.end(), trigger) == ignored.end();
            exposures.add(exposure);
        }
    }

    /// There is no exposure line.
    void forget_lines() {
        ExposureLog unseen(Limits{}.period);
        for (std::size_t i = 0; i < exposures.size(); ++i) {
            Exposure exposure = exposures[i].exposure;
            exposure.kind = StampKind::trigger_edge;
            unseen.add(exposure);
        }
        exposures = unseen;
    }

    /// The frame of the exposure with this number.
    void frame(std::uint64_t trigger, Duration late = milliseconds(3)) {
        const Exposure& exposure = exposures.find(trigger)->exposure;
        Arrival arrival;
        arrival.block_id = 100 + trigger;
        arrival.camera_time = CameraTime{exposure.start.ns + 9'000'000'000};
        arrival.arrived = exposure.end_on_host + late;
        frames.push_back(arrival);
    }

    std::vector<std::uint64_t> align(Instant instant = Instant::start) const {
        return pairing::align(frames, exposures, std::array{instant}, Limits{});
    }

    ExposureLog exposures;
    std::vector<Arrival> frames;
};

using Triggers = std::vector<std::uint64_t>;
using Gaps = std::vector<int>;

/// Between the pulses of a start pattern and of the regular ticks after it.
Gaps gaps_of_start(std::uint32_t bits) {
    Gaps gaps;
    int last = 0;
    for (int tick = 1; tick < static_cast<int>(wire::start_pattern_length) + 4; ++tick) {
        const bool after = tick >= static_cast<int>(wire::start_pattern_length);
        if (after || (bits >> static_cast<unsigned>(tick) & 1U) != 0)
            gaps.push_back(tick - std::exchange(last, tick));
    }
    return gaps;
}

}  // namespace

TEST_CASE(
    "alignment: irregular gaps name the triggers, regular ones and too few frames name nothing") {
    AlignmentBench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {1, 2, 3, 4}) bench.frame(trigger);
    CHECK(bench.align().empty());
    bench.frame(5);
    CHECK(bench.align() == Triggers{1, 2, 3, 4, 5});
    AlignmentBench regular({0, 1, 2, 3, 4, 5, 6, 7});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6}) regular.frame(trigger);
    CHECK(regular.align().empty());
}

TEST_CASE(
    "alignment: four gaps have one place in all start patterns, and the first four prove it") {
    std::set<Gaps> places;
    for (const std::uint32_t bits : wire::start_pattern_bits) {
        const Gaps gaps = gaps_of_start(bits);
        const auto first = gaps.begin();
        const int shortest = *std::min_element(first, first + 4);
        CHECK(std::count_if(first, first + 4, [=](int gap) { return gap > shortest; }) >= 2);
        for (auto gap = first; gap + 4 <= gaps.end(); ++gap) {
            const Gaps place(gap, gap + 4);
            CAPTURE(bits, place);
            CHECK((place == Gaps(4, place.front()) || places.insert(place).second));
        }
    }
}

TEST_CASE("alignment: a gap where a frame was lost is no place in the pattern") {
    // The record of the first frame is not there any more: all of them fit one exposure later.
    AlignmentBench bench({0, 1, 2, 3, 4, 5, 6, 8, 9});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6, 8}) bench.frame(trigger);
    bench.exposures.pop_front();
    CHECK(bench.align().empty());
}

TEST_CASE("alignment: a single longer gap is no place in the pattern") {
    // The grid may have waited there, because the board's time was set back.
    AlignmentBench bench({0, 1, 2, 3, 4, 6, 7});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6, 7}) bench.frame(trigger);
    CHECK(bench.align().empty());
}

TEST_CASE("alignment: a late frame is left out of the proof") {
    AlignmentBench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6})
        bench.frame(trigger, milliseconds(trigger == 3 ? 40 : 3));
    CHECK(bench.align() == Triggers{1, 2, 0, 4, 5, 6});
}

TEST_CASE("alignment: ids, exposure lengths and silent lines refute") {
    AlignmentBench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5}) bench.frame(trigger);
    SECTION("a step of ids that is too long") { bench.frames[3].block_id += 5; }
    SECTION("ids that begin anew") { bench.frames[2].block_id = 1; }
    SECTION("an exposure of another length") { bench.frames[2].exposure = milliseconds(3); }
    SECTION("a camera that did not expose") { bench.exposures.find(3)->exposure.exposed = false; }
    CHECK(bench.align().empty());
}

TEST_CASE("alignment: by arrival alone triggers must be further apart than frames may be late") {
    AlignmentBench near({0, 1, 3, 4, 7, 9, 11});
    AlignmentBench far({0, 20, 40, 60});
    for (const std::uint64_t trigger : {1, 2, 3, 4}) {
        near.frame(trigger);
        far.frame(trigger);
    }
    CHECK(near.align(Instant::arrival).empty());
    CHECK(far.align(Instant::arrival) == Triggers{1, 2, 3, 4});
    CHECK(far.align(Instant::start).empty());
}

TEST_CASE("alignment: a missing record leaves it open") {
    AlignmentBench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {2, 3, 4, 5, 6}) bench.frame(trigger);
    AlignmentBench holed({0});
    for (std::size_t i = 1; i < bench.exposures.size(); ++i)
        if (i != 3) holed.exposures.add(bench.exposures[i].exposure);
    holed.frames = bench.frames;
    CHECK(holed.align().empty());
}

namespace {

/// A record of this number, the `recorded`-th, with so many silent ones until it.
Record recorded(std::uint64_t trigger, std::uint64_t count, std::uint64_t silent = 0,
                bool exposed = true) {
    Record record;
    record.exposure.trigger = trigger;
    record.exposure.exposed = exposed;
    record.recorded = count;
    record.silent = silent;
    return record;
}

}  // namespace

TEST_CASE("alignment: a frame arrives within its limits after the end of its exposure") {
    Limits limits;
    limits.earliest_arrival = -milliseconds(5);
    limits.latest_arrival = milliseconds(500);
    Exposure exposure;
    exposure.earliest_on_host = HostTime{1'000'000'000};
    const auto possible = [&](Duration after) {
        Arrival arrival;
        arrival.arrived = exposure.earliest_on_host + after;
        return arrival_possible(limits, arrival, exposure);
    };
    CHECK(possible(-milliseconds(5)));
    CHECK_FALSE(possible(-milliseconds(5) - nanoseconds(1)));
    CHECK(possible(milliseconds(500)));
    CHECK_FALSE(possible(milliseconds(500) + nanoseconds(1)));
}

TEST_CASE("alignment: triggers that a camera may have ignored are silent, or without record") {
    const Record from = recorded(10, 10, 2);
    CHECK(perhaps_not_taken(from, recorded(11, 11, 2)) == 0);
    CHECK(perhaps_not_taken(from, recorded(15, 15, 2)) == 0);
    CHECK(perhaps_not_taken(from, recorded(15, 15, 3)) == 1);
    CHECK(perhaps_not_taken(from, recorded(15, 13, 2)) == 2);
    CHECK(perhaps_not_taken(from, recorded(15, 13, 3)) == 3);
    // Whether the last one was taken is not asked.
    CHECK(perhaps_not_taken(from, recorded(15, 15, 3, false)) == 0);
    CHECK(perhaps_not_taken(from, recorded(15, 15, 4, false)) == 1);
    CHECK(perhaps_not_taken(from, recorded(12, 12, 9)) == 1);
    // Records that came twice as often as triggers take nothing away.
    CHECK(perhaps_not_taken(from, recorded(12, 19, 2)) == 0);
}

TEST_CASE("alignment: ids count triggers, or those that were taken, and else it takes faults") {
    const Record from = recorded(10, 10);
    for (const auto& [step, faults] : {std::pair{0U, impossible_step},
                                       {1U, 4U},
                                       {2U, 3U},
                                       {3U, 2U},
                                       {4U, 1U},
                                       {5U, 0U},
                                       {6U, impossible_step}})
        CHECK(step_faults(step, from, recorded(15, 15)) == faults);
    for (const auto& [step, faults] :
         {std::pair{1U, 2U}, {2U, 1U}, {3U, 0U}, {4U, 0U}, {5U, 0U}, {6U, impossible_step}})
        CHECK(step_faults(step, from, recorded(15, 14, 1)) == faults);
    CHECK(step_faults(1, from, recorded(10, 10)) == impossible_step);
    CHECK(step_faults(1, from, recorded(9, 9)) == impossible_step);
    CHECK(step_faults(1, from, recorded(11, 11)) == 0);
    CHECK(faults_to_refute == 2);
}

TEST_CASE("alignment: lengths differ by more than 0.2 ms and a twentieth") {
    for (const Duration measured : {milliseconds(1), milliseconds(4)})
        for (const int side : {-1, 1}) {
            CHECK_FALSE(lengths_differ(measured + microseconds(200) * side, measured));
            CHECK(lengths_differ(measured + (microseconds(200) + nanoseconds(1)) * side, measured));
        }
    CHECK_FALSE(lengths_differ(milliseconds(105), milliseconds(100)));
    CHECK(lengths_differ(milliseconds(105) + nanoseconds(1), milliseconds(100)));
    CHECK(lengths_differ(milliseconds(95) - nanoseconds(1), milliseconds(100)));
    Arrival arrival;
    arrival.exposure = milliseconds(3);
    Exposure exposure;
    exposure.end = exposure.start + milliseconds(2);
    CHECK(length_contradicts(arrival, exposure));
    exposure.kind = StampKind::predicted_middle;
    CHECK_FALSE(length_contradicts(arrival, exposure));
    exposure.kind = StampKind::measured_middle;
    arrival.exposure = {};
    CHECK_FALSE(length_contradicts(arrival, exposure));
    arrival.exposure = milliseconds(2);
    CHECK_FALSE(length_contradicts(arrival, exposure));
}

TEST_CASE("alignment: five frames prove a start by the clock, three by arrival") {
    CHECK(frames_for_proof(true) == 5);
    CHECK(frames_for_proof(false) == 3);
    AlignmentBench far({0, 20, 40});
    for (const std::uint64_t trigger : {1, 2, 3}) far.frame(trigger);
    CHECK(far.align(Instant::arrival) == Triggers{1, 2, 3});
    far.frames.pop_back();
    CHECK(far.align(Instant::arrival).empty());
}

TEST_CASE("alignment: by arrival, each neighbour is further away than a frame may be late") {
    const Limits limits;
    const Duration window = limits.latest_arrival - limits.earliest_arrival;
    for (const Duration gap : {window, window + nanoseconds(1)})
        for (const std::size_t place : {1U, 2U, 3U}) {
            AlignmentBench bench({0, 20, 40, 60});
            ExposureLog moved(limits.period);
            BoardTime start{1'000'000'000};
            for (std::size_t i = 0; i < 4; ++i) {
                if (i > 0) start = start + (i == place ? gap : seconds(1));
                Exposure exposure = bench.exposures[i].exposure;
                exposure.start = start;
                exposure.end = start + milliseconds(2);
                exposure.end_on_host = exposure.earliest_on_host = HostTime{exposure.end.ns};
                moved.add(exposure);
            }
            bench.exposures = moved;
            for (const std::uint64_t trigger : {1, 2, 3}) bench.frame(trigger);
            CHECK(bench.align(Instant::arrival).empty() == (gap == window));
        }
}

TEST_CASE("alignment: times a quarter of a gap off are of an exposure, and no further") {
    for (const auto& [off_ns, found] : {std::pair{12'500'000LL, true},
                                        {12'500'001LL, false},
                                        {-12'500'000LL, true},
                                        {-12'500'001LL, false}}) {
        AlignmentBench bench({0, 1, 3, 4, 7, 9, 11});
        for (const std::uint64_t trigger : {1, 2, 3, 4, 5}) bench.frame(trigger);
        // The first frame's difference of the clocks is tried; the others are off by all of it.
        for (std::size_t i = 1; i < 5; ++i) bench.frames[i].camera_time.ns += off_ns;
        const bool aligned = !bench.align().empty();
        CHECK((aligned || !found));
    }
}

TEST_CASE("alignment: one that is later than the others by 0.6 gaps is not proved with them") {
    for (const auto& [late, kept] :
         {std::pair{milliseconds(33), true}, {milliseconds(33) + nanoseconds(1), false}}) {
        AlignmentBench bench({0, 1, 3, 4, 7, 9, 11});
        for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6})
            bench.frame(trigger, trigger == 3 ? late : milliseconds(3));
        CHECK(bench.align() == (kept ? Triggers{1, 2, 3, 4, 5, 6} : Triggers{1, 2, 0, 4, 5, 6}));
    }
}

TEST_CASE("alignment: an exposure has one frame at most, and none that it had before") {
    AlignmentBench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5}) bench.frame(trigger);
    SECTION("two frames of one") {
        bench.frame(5);
        CHECK(bench.align().empty());
    }
    SECTION("one that was published") {
        bench.exposures.find(2)->used = true;
        CHECK(bench.align().empty());
    }
    SECTION("an id that counts one too few") {
        for (std::size_t i = 3; i < 5; ++i) --bench.frames[i].block_id;
        CHECK(bench.align().empty());
    }
}

TEST_CASE("alignment: a trigger that goes back takes more faults than are borne") {
    CHECK(step_faults(static_cast<std::uint64_t>(-3), recorded(5, 5), recorded(2, 2)) ==
          impossible_step);
    CHECK(step_faults(0, recorded(5, 5), recorded(5, 5)) == impossible_step);
    CHECK(impossible_step > unseen_faults_to_refute);
}

TEST_CASE("alignment: one fault leaves it open") {
    AlignmentBench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 6, 7}) bench.frame(trigger);
    CHECK(bench.align().size() == 6);
    for (std::size_t i = 4; i < 6; ++i) --bench.frames[i].block_id;  // one that nobody counted
    CHECK(bench.align().empty());
}

TEST_CASE("alignment: where no line shows what was taken, a start takes eight frames") {
    AlignmentBench bench({0, 1, 3, 4, 7, 8, 10, 11, 14});
    bench.forget_lines();
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6, 7}) bench.frame(trigger);
    CHECK(bench.align().empty());
    bench.frame(8);
    CHECK(bench.align().size() == 8);
}

TEST_CASE("alignment: ignored triggers that nobody saw may imitate a pattern of before") {
    // Frames of regular triggers, of which the camera left out just those that the pattern lacks.
    std::vector<int> ticks{0, 1, 3, 4, 7, 9, 11, 14};
    for (int tick = 15; tick < 40; ++tick) ticks.push_back(tick);
    AlignmentBench bench(ticks);
    bench.forget_lines();
    Limits slow_link;
    slow_link.latest_arrival = seconds(2);
    std::uint64_t id = 100;
    for (const std::uint64_t trigger : {11, 12, 14, 15, 18, 20, 22, 25}) {
        bench.frame(trigger);
        bench.frames.back().block_id = ++id;  // it does not count what it ignored
    }
    const auto align = [&] {
        return pairing::align(bench.frames, bench.exposures, std::array{Instant::start}, slow_link);
    };
    CHECK(align().empty());
    // Where no newer exposures explain them, they are of the pattern.
    for (Arrival& frame : bench.frames) frame.arrived = frame.arrived - milliseconds(850);
    CHECK(align() == Triggers{1, 2, 3, 4, 5, 6, 7, 8});
}

TEST_CASE("alignment: records that are not there yet speak against a place, four gaps far") {
    // The same gaps once more, but the record of the last exposure is still on its way.
    const std::vector<int> twice{0, 1, 3, 4, 7, 14, 15, 17, 18, 21};
    for (const Duration seen_later : {Duration{}, milliseconds(-150)}) {
        AlignmentBench all(twice);
        for (const std::uint64_t trigger : {6, 7, 8, 9, 10}) all.frame(trigger);
        AlignmentBench bench({0, 1, 3, 4, 7, 14, 15, 17, 18});
        for (Arrival& frame : all.frames) frame.arrived = frame.arrived + seen_later;
        bench.frames = all.frames;
        Limits patient;
        patient.latest_arrival = seconds(2);
        CHECK(pairing::align(bench.frames, bench.exposures, std::array{Instant::start}, patient)
                  .empty());
    }
}

TEST_CASE("alignment: a trigger whose line was silent has no frame to lose") {
    // The camera takes those that come 100 ms after another at least: its gaps are 3, 4, 3, 4.
    for (const bool seen : {true, false}) {
        AlignmentBench bench({0, 1, 3, 4, 7, 8, 10, 11, 14},
                             seen ? Triggers{2, 4, 6, 8} : Triggers{});
        for (const std::uint64_t trigger : {1, 3, 5, 7, 9}) bench.frame(trigger);
        CHECK(bench.align() == (seen ? Triggers{1, 3, 5, 7, 9} : Triggers{}));
    }
}

TEST_CASE("alignment: one that takes a fault keeps another from being the only one") {
    // The same pattern twice; the first time without its fifth trigger.
    AlignmentBench bench({0, 1, 3, 4, 9, 11, 20, 21, 23, 24, 27, 29, 31});
    Limits limits;
    limits.latest_arrival = seconds(3);
    const auto align_to = [&](const std::vector<std::uint64_t>& triggers) {
        bench.frames.clear();
        for (const std::uint64_t trigger : triggers) bench.frame(trigger);
        for (std::size_t i = 0; i < bench.frames.size(); ++i) bench.frames[i].block_id = 7 + i;
        return align(bench.frames, bench.exposures, std::array{Instant::start}, limits);
    };
    CHECK(align_to({7, 8, 9, 10, 12, 13}).empty());
}

TEST_CASE("alignment: two places that fit leave it open") {
    AlignmentBench once({0, 1, 3, 4, 7, 9, 11});
    AlignmentBench twice({0, 1, 3, 4, 7, 9, 11, 40, 41, 43, 44, 47, 49, 51});
    Limits limits;
    limits.latest_arrival = seconds(5);
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6}) once.frame(trigger);
    for (const std::uint64_t trigger : {8, 9, 10, 11, 12, 13}) twice.frame(trigger);
    CHECK(align(once.frames, once.exposures, std::array{Instant::start}, limits).size() == 6);
    CHECK(align(twice.frames, twice.exposures, std::array{Instant::start}, limits).empty());
}

TEST_CASE("alignment: without two frames in a row no gap says anything") {
    AlignmentBench bench({0, 1, 3, 4, 7, 9, 11, 12, 14, 17});
    for (const std::uint64_t trigger : {1, 3, 5, 7, 9}) bench.frame(trigger);
    CHECK(bench.align().empty());
}

TEST_CASE("alignment: by arrival, what precedes the first frame must be far away, too") {
    AlignmentBench close({0, 2, 22, 42, 62});
    AlignmentBench far({0, 20, 40, 60, 80});
    for (const std::uint64_t trigger : {2, 3, 4, 5}) {
        close.frame(trigger);
        far.frame(trigger);
    }
    CHECK(close.align(Instant::arrival).empty());
    CHECK(far.align(Instant::arrival) == Triggers{2, 3, 4, 5});
}

TEST_CASE("alignment: limits, unless they are said") {
    const Limits limits;
    CHECK(limits.period == milliseconds(50));
    CHECK(limits.pattern_duration == seconds(1));
    CHECK(limits.frames_held == 8);
    CHECK(limits.camera_clock);
    CHECK(limits.stamped == Instant::unknown);
}
