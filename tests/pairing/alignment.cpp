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
class Bench {
 public:
    explicit Bench(const std::vector<int>& ticks) : exposures(Limits{}.period) {
        std::uint64_t trigger = 0;
        for (const int tick : ticks) {
            Exposure exposure;
            exposure.trigger = ++trigger;
            exposure.start = BoardTime{1'000'000'000 + tick * 50'000'000LL};
            exposure.end = exposure.start + milliseconds(2);
            exposure.end_on_host = exposure.earliest_on_host = HostTime{exposure.end.ns};
            exposures.add(exposure);
        }
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
    Bench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {1, 2, 3, 4}) bench.frame(trigger);
    CHECK(bench.align().empty());
    bench.frame(5);
    CHECK(bench.align() == Triggers{1, 2, 3, 4, 5});
    Bench regular({0, 1, 2, 3, 4, 5, 6, 7});
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
    Bench bench({0, 1, 2, 3, 4, 5, 6, 8, 9});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6, 8}) bench.frame(trigger);
    bench.exposures.pop_front();
    CHECK(bench.align().empty());
}

TEST_CASE("alignment: a single longer gap is no place in the pattern") {
    // The grid may have waited there, because the board's time was set back.
    Bench bench({0, 1, 2, 3, 4, 6, 7});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6, 7}) bench.frame(trigger);
    CHECK(bench.align().empty());
}

TEST_CASE("alignment: a late frame is left out of the proof") {
    Bench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5, 6})
        bench.frame(trigger, milliseconds(trigger == 3 ? 40 : 3));
    CHECK(bench.align() == Triggers{1, 2, 0, 4, 5, 6});
}

TEST_CASE("alignment: ids, exposure lengths and silent lines refute") {
    Bench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {1, 2, 3, 4, 5}) bench.frame(trigger);
    SECTION("a step of ids that is too long") { bench.frames[3].block_id += 5; }
    SECTION("ids that begin anew") { bench.frames[2].block_id = 1; }
    SECTION("an exposure of another length") { bench.frames[2].exposure = milliseconds(3); }
    SECTION("a camera that did not expose") { bench.exposures.find(3)->exposure.exposed = false; }
    CHECK(bench.align().empty());
}

TEST_CASE("alignment: by arrival alone triggers must be further apart than frames may be late") {
    Bench near({0, 1, 3, 4, 7, 9, 11});
    Bench far({0, 20, 40, 60});
    for (const std::uint64_t trigger : {1, 2, 3, 4}) {
        near.frame(trigger);
        far.frame(trigger);
    }
    CHECK(near.align(Instant::arrival).empty());
    CHECK(far.align(Instant::arrival) == Triggers{1, 2, 3, 4});
    CHECK(far.align(Instant::start).empty());
}

TEST_CASE("alignment: a missing record leaves it open") {
    Bench bench({0, 1, 3, 4, 7, 9, 11});
    for (const std::uint64_t trigger : {2, 3, 4, 5, 6}) bench.frame(trigger);
    Bench holed({0});
    for (std::size_t i = 1; i < bench.exposures.size(); ++i)
        if (i != 3) holed.exposures.add(bench.exposures[i].exposure);
    holed.frames = bench.frames;
    CHECK(holed.align().empty());
}
