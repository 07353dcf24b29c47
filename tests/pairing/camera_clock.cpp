// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/camera_clock.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>

using namespace versavis;
using namespace versavis::pairing;

namespace {

/// Exposures at 20 Hz of a camera that stamps one of their instants, by a clock 80 ppm fast.
class Bench {
 public:
    Bench(Instant stamps, Instant told) : clock(told), stamps_(stamps) {}

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
    Bench bench(stamps, Instant::unknown);
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
    Bench said(Instant::end, Instant::start);
    for (int i = 0; i < 50; ++i) said.frame(milliseconds(i % 2 == 0 ? 30 : 2));
    CHECK(said.clock.stamped() == Instant::start);
    said.clock.forget();
    CHECK(said.clock.stamped() == Instant::start);
}

TEST_CASE("camera_clock: changes that nobody measured, or that no instant explains, say nothing") {
    Bench bench(Instant::end, Instant::unknown);
    for (int i = 0; i < 50; ++i)
        bench.frame(milliseconds(i % 2 == 0 ? 30 : 2), StampKind::trigger_edge);
    CHECK(bench.clock.stamped() == Instant::unknown);
    Bench odd(Instant::start, Instant::unknown);
    for (int i = 0; i < 50; ++i) {  // its stamps move by a quarter of each change
        const Duration length = milliseconds(i % 2 == 0 ? 30 : 2);
        const Record record = odd.expose(length);
        odd.clock.track(odd.stamp(record) + length / 4, record);
    }
    CHECK(odd.clock.stamped() == Instant::unknown);
}

TEST_CASE("camera_clock: five votes in a row make it known") {
    for (const int changes : {4, 5}) {
        Bench bench(Instant::end, Instant::unknown);
        for (int i = 0; i < 100; ++i) bench.frame(milliseconds(2));
        for (int i = 0; i < changes; ++i) bench.frame(milliseconds(i % 2 == 0 ? 30 : 2));
        CHECK((bench.clock.stamped() == Instant::end) == (changes == 5));
    }
    // A vote for another instant in between: they begin anew.
    Bench bench(Instant::end, Instant::unknown);
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
    Bench bench(Instant::start, Instant::start);
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
