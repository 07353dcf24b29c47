// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/camera_clock.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>

using namespace versavis;
using namespace versavis::pairing;

namespace {

/// Exposures at 20 Hz of a camera that stamps one of their instants, by a clock 80 ppm fast.
class ClockBench {
 public:
    ClockBench(Instant stamps, Instant assumed) : clock(assumed), stamps_(stamps) {}

    Record expose(Duration length, StampKind kind = StampKind::measured_middle) {
        at_ = at_ + milliseconds(50);
        Exposure exposure;
        exposure.start = at_;
        exposure.end = at_ + length;
        exposure.kind = kind;
        ExposureLog log(milliseconds(50));
        log.add(exposure);
        return log.back();
    }

    CameraTime stamp(const Record& record) const {
        const std::int64_t ns = record.instant_ns(stamps_);
        return {5'000'000'000 + ns + ns / 12'500};
    }

    void frame(Duration length, StampKind kind = StampKind::measured_middle) {
        const Record record = expose(length, kind);
        clock.track(stamp(record), record);
    }

    CameraClock clock;

 private:
    Instant stamps_;
    BoardTime at_;
};

}  // namespace

TEST_CASE("camera_clock: what is stamped is unknown until exposures vary, then it is found out") {
    const Instant stamps = GENERATE(Instant::start, Instant::middle, Instant::end);
    ClockBench bench(stamps, Instant::unknown);
    for (int i = 0; i < 200; ++i) bench.frame(milliseconds(2));
    CHECK(bench.clock.stamped() == Instant::unknown);
    CHECK(bench.clock.possible().size() == 3);
    for (int i = 0; i < 5; ++i) bench.frame(milliseconds(i % 2 == 0 ? 30 : 2));
    CHECK(bench.clock.stamped() == stamps);
    CHECK(bench.clock.possible().size() == 1);
    const Record next = bench.expose(milliseconds(30));
    CHECK(std::abs(bench.clock.expected_instant_ns(stamps, bench.stamp(next)) -
                   next.instant_ns(stamps)) < 20'000);
}

TEST_CASE("camera_clock: what was said or found out stays, whatever is seen") {
    ClockBench said(Instant::end, Instant::start);
    for (int i = 0; i < 50; ++i) said.frame(milliseconds(i % 2 == 0 ? 30 : 2));
    CHECK(said.clock.stamped() == Instant::start);
    said.clock.forget();
    CHECK(said.clock.stamped() == Instant::start);
}

TEST_CASE("camera_clock: changes that nobody measured, or that no instant explains, say nothing") {
    ClockBench bench(Instant::end, Instant::unknown);
    for (int i = 0; i < 50; ++i)
        bench.frame(milliseconds(i % 2 == 0 ? 30 : 2), StampKind::trigger_edge);
    CHECK(bench.clock.stamped() == Instant::unknown);
    ClockBench odd(Instant::start, Instant::unknown);
    for (int i = 0; i < 50; ++i) {  // its stamps move by a quarter of each change
        const Duration length = milliseconds(i % 2 == 0 ? 30 : 2);
        const Record record = odd.expose(length);
        odd.clock.track(odd.stamp(record) + length / 4, record);
    }
    CHECK(odd.clock.stamped() == Instant::unknown);
}

TEST_CASE("camera_clock: five votes in a row make it known") {
    for (const int changes : {4, 5}) {
        ClockBench bench(Instant::end, Instant::unknown);
        for (int i = 0; i < 100; ++i) bench.frame(milliseconds(2));
        for (int i = 0; i < changes; ++i) bench.frame(milliseconds(i % 2 == 0 ? 30 : 2));
        CHECK((bench.clock.stamped() == Instant::end) == (changes == 5));
    }
    // A vote for another instant in between: they begin anew.
    ClockBench bench(Instant::end, Instant::unknown);
    for (int i = 0; i < 100; ++i) bench.frame(milliseconds(2));
    for (int i = 0; i < 4; ++i) bench.frame(milliseconds(i % 2 == 0 ? 30 : 2));
    const Record odd = bench.expose(milliseconds(30));
    bench.clock.track({bench.stamp(odd).ns - milliseconds(28).ns}, odd);
    CHECK(bench.clock.stamped() == Instant::unknown);
}

TEST_CASE("camera_clock: what a stamp may say, and what the board saw of it") {
    const CameraClock unknown(Instant::unknown);
    REQUIRE(unknown.possible().size() == 3);
    CHECK(unknown.possible()[0] == Instant::start);
    CHECK(unknown.possible()[1] == Instant::middle);
    CHECK(unknown.possible()[2] == Instant::end);
    for (const Instant instant : {Instant::start, Instant::middle, Instant::end}) {
        const CameraClock known(instant);
        REQUIRE(known.possible().size() == 1);
        CHECK(known.possible()[0] == instant);
        Exposure exposure;
        CHECK(seen(exposure, instant));
        exposure.kind = StampKind::predicted_middle;
        CHECK(seen(exposure, instant) == (instant == Instant::start));
    }
    CHECK(std::string(to_string(Instant::unknown)) == "unknown");
    CHECK(std::string(to_string(Instant::start)) == "start");
    CHECK(std::string(to_string(Instant::middle)) == "middle");
    CHECK(std::string(to_string(Instant::end)) == "end");
    CHECK(std::string(to_string(Instant::arrival)) == "arrival");
    CHECK(std::string(to_string(static_cast<Instant>(9))) == "unknown");
}

TEST_CASE("camera_clock: a clock that stepped is followed from there, one forgotten begins anew") {
    ClockBench bench(Instant::start, Instant::start);
    for (int i = 0; i < 10; ++i) bench.frame(milliseconds(2));
    const Record record = bench.expose(milliseconds(2));
    const CameraTime stepped{bench.stamp(record).ns + seconds(3).ns};
    bench.clock.move(stepped, record);
    CHECK(bench.clock.expected_instant_ns(Instant::start, stepped) ==
          record.instant_ns(Instant::start));
    bench.clock.forget();
    const Record next = bench.expose(milliseconds(2));
    bench.clock.track(bench.stamp(next), next);
    CHECK(bench.clock.expected_instant_ns(Instant::start, bench.stamp(next)) ==
          next.instant_ns(Instant::start));
    CHECK(bench.clock.tolerance_ns(Instant::start, bench.stamp(next)) == 30'000);
}

TEST_CASE("camera_clock: an instant that was not seen begins a relation, and moves none") {
    CameraClock clock(Instant::unknown);
    ExposureLog log(milliseconds(50));
    const auto track = [&](std::int64_t at_ms, std::int64_t off_ms) {
        Exposure exposure;
        exposure.trigger = static_cast<std::uint64_t>(at_ms);
        exposure.start = BoardTime{at_ms * 1'000'000};
        exposure.end = exposure.start + milliseconds(2);
        exposure.kind = StampKind::trigger_edge;
        log.add(exposure);
        clock.track(CameraTime{(at_ms + off_ms) * 1'000'000}, log.back());
    };
    track(50, 1000);
    const auto end_ns = [&] { return clock.expected_instant_ns(Instant::end, {2'000'000'000}); };
    const auto start_ns = [&] {
        return clock.expected_instant_ns(Instant::start, {2'000'000'000});
    };
    CHECK(end_ns() == 1'002'000'000);
    CHECK(start_ns() == 1'000'000'000);
    track(100, 1003);
    CHECK(end_ns() == 1'002'000'000);
    CHECK(start_ns() < 1'000'000'000);
}

namespace {

/// Votes for the end, by changes of this size, one per frame.
bool knows_after(CameraClock& clock, ExposureLog& log, int votes, Duration change, Duration apart,
                 Duration jitter = {}) {
    static constexpr std::int64_t base = 5'000'000;
    const std::size_t begun = log.size();
    for (int i = 0; i <= votes; ++i) {
        Exposure exposure;
        exposure.trigger = begun + static_cast<std::uint64_t>(i) + 1;
        const BoardTime last = log.empty() ? BoardTime{} : log.back().exposure.start;
        exposure.start = last + apart;
        exposure.end = exposure.start + nanoseconds(base) + (i % 2 == 0 ? Duration{} : change);
        log.add(exposure);
        const Duration off = i % 2 == 0 ? jitter : -jitter;
        clock.track(CameraTime{exposure.end.ns + off.ns}, log.back());
    }
    return clock.stamped() == Instant::end;
}

}  // namespace

TEST_CASE("camera_clock: a change must stand out of jitter, and of the time that passed") {
    const auto knows = [](Duration change, Duration apart) {
        CameraClock clock(Instant::unknown);
        ExposureLog log(apart);
        return knows_after(clock, log, 20, change, apart);
    };
    CHECK(knows(microseconds(1100), milliseconds(50)));
    CHECK_FALSE(knows(microseconds(1100), seconds(1)));
    CHECK(knows(microseconds(4000), seconds(1)));
    // Stamps that jitter by 30 us: a mean deviation that 20 times outdoes 400 us.
    CameraClock clock(Instant::unknown);
    ExposureLog log(milliseconds(50));
    knows_after(clock, log, 60, {}, milliseconds(50), microseconds(30));
    CHECK_FALSE(knows_after(clock, log, 20, microseconds(500), milliseconds(50)));
}

TEST_CASE("camera_clock: votes for different instants do not add up") {
    CameraClock clock(Instant::unknown);
    ExposureLog log(milliseconds(50));
    for (int i = 0; i < 6; ++i) {
        Exposure exposure;
        exposure.trigger = static_cast<std::uint64_t>(i) + 1;
        exposure.start = BoardTime{} + milliseconds(50) * (i + 1);
        exposure.end = exposure.start + milliseconds(i % 2 == 0 ? 5 : 8);
        log.add(exposure);
        // Four changes leave the stamp at the start, the fifth moves it as if it were the middle.
        const Duration off = i < 5 ? Duration{} : microseconds(1500);
        clock.track(CameraTime{exposure.start.ns + off.ns}, log.back());
    }
    CHECK(clock.stamped() == Instant::unknown);
}

TEST_CASE("camera_clock: no vote compares with a frame from before a step of the clock") {
    for (const bool forgets : {false, true}) {
        CameraClock clock(Instant::unknown);
        ExposureLog log(milliseconds(50));
        knows_after(clock, log, 4, milliseconds(3), milliseconds(50));
        CHECK(clock.stamped() == Instant::unknown);
        if (forgets)
            clock.forget();
        else
            clock.move(CameraTime{log.back().end.ns + 80'000'000'000}, log.back());
        // A first frame far off, then one vote: the fifth.
        Exposure exposure;
        exposure.kind = StampKind::measured_middle;
        for (const auto& [at_ms, length_ms] : {std::pair{1000, 8}, {1050, 5}}) {
            exposure.trigger += 100;
            exposure.start = BoardTime{at_ms * 1'000'000LL};
            exposure.end = exposure.start + milliseconds(length_ms);
            log.add(exposure);
            clock.track(CameraTime{exposure.end.ns + 80'000'000'000}, log.back());
        }
        CHECK(clock.stamped() == Instant::end);
    }
}

TEST_CASE("camera_clock: after all is forgotten, rates are learned again") {
    ClockBench bench(Instant::start, Instant::start);
    for (int i = 0; i < 10; ++i) bench.frame(milliseconds(5));
    bench.clock.forget();
    for (int i = 0; i < 600; ++i) bench.frame(milliseconds(5));
    Record later = bench.expose(milliseconds(5));
    for (int i = 0; i < 100; ++i) later = bench.expose(milliseconds(5));
    const std::int64_t off = bench.clock.expected_instant_ns(Instant::start, bench.stamp(later)) -
                             later.instant_ns(Instant::start);
    CHECK(std::abs(off) < 20'000);
}
