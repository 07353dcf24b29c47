// SPDX-License-Identifier: BSD-3-Clause
#include "plausibility/exposure_validator.hpp"

#include <rapidcheck.h>
#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

CameraConfiguration camera() {
    CameraConfiguration configuration;
    configuration.rate_hz = 20;
    configuration.exposure_us = 4000;
    configuration.max_exposure_us = 40'000;
    return configuration;
}

/// The record of the trigger at `tick`, as the board sends it: its middle is on the grid if the
/// exposure is as expected.
wire::Exposure record(std::uint64_t tick, Duration exposure, Duration expected) {
    wire::Exposure made{};
    made.trigger = made.tick = tick;
    made.flags = wire::exposure_measured;
    made.trigger_ns = static_cast<std::int64_t>(tick) * 50'000'000 - expected.ns / 2;
    made.start_ns = made.trigger_ns + 20'000;
    made.end_ns = made.start_ns + exposure.ns;
    return made;
}

wire::Exposure displaced(wire::Exposure made, std::uint64_t trigger, Duration by) {
    made.trigger = trigger;
    made.trigger_ns += by.ns;
    made.start_ns += by.ns;
    made.end_ns += by.ns;
    return made;
}

struct Bench {
    bool believes(const wire::Exposure& made, Duration told = {}) {
        return !contradicts_itself(made, configuration) &&
               !witness.judge(ExposureObservation{made, told}, 0);
    }
    CameraConfiguration configuration = camera();
    ExposureValidator witness{ExposureHistory(configuration)};
};

}  // namespace

TEST_CASE("exposure_validator: exposures that vary move the triggers, and are believed") {
    Bench bench;
    Duration expected = milliseconds(4);
    const std::vector<Duration> exposures{milliseconds(4),  milliseconds(4), milliseconds(30),
                                          milliseconds(30), milliseconds(2), milliseconds(2),
                                          milliseconds(17), milliseconds(1)};
    for (std::uint64_t tick = 1; tick < 100; ++tick) {
        const Duration exposure = exposures[tick % exposures.size()];
        CHECK(bench.believes(record(tick, exposure, expected)));
        expected = exposure;
    }
}

TEST_CASE("exposure_validator: an exposure of which the camera says that it is fixed stays so") {
    Bench bench;
    const Duration fixed = milliseconds(4);
    for (std::uint64_t tick = 1; tick < 40; ++tick)
        CHECK(bench.believes(record(tick, fixed, fixed), fixed));
    CHECK_FALSE(bench.believes(record(40, fixed + microseconds(150), fixed), fixed));
    // Set anew, the new one is learned.
    CHECK(bench.believes(record(41, milliseconds(9), fixed), milliseconds(9)));
    CHECK_FALSE(bench.believes(record(42, milliseconds(11), milliseconds(9)), milliseconds(9)));
}

TEST_CASE("exposure_validator: lost records, skipped triggers and late ones are no contradiction") {
    Bench bench;
    const Duration fixed = milliseconds(4);
    for (std::uint64_t tick = 1; tick < 20; ++tick) bench.believes(record(tick, fixed, fixed));
    wire::Exposure skipped = record(25, fixed, fixed);
    skipped.trigger = 22;
    CHECK_FALSE(bench.believes(skipped));
    bench.witness.believed().triggers_skipped(1);
    CHECK_FALSE(bench.believes(skipped));
    bench.witness.believed().triggers_skipped(2);
    CHECK(bench.believes(skipped));
    wire::Exposure late = displaced(record(26, fixed, fixed), 23, microseconds(1500));
    CHECK_FALSE(bench.believes(late));
    late.flags |= wire::exposure_late;
    CHECK(bench.believes(late));
    // It excuses nothing in those after it.
    CHECK_FALSE(bench.believes(displaced(record(27, fixed, fixed), 24, microseconds(500))));
    wire::Exposure next = record(27, fixed, fixed);
    next.trigger = 24;
    CHECK(bench.believes(next));
}

TEST_CASE("exposure_validator: flags tell which line there is") {
    Bench bench;
    bench.configuration.strobe = GENERATE(Strobe::active_high, Strobe::none);
    bench.configuration.master = GENERATE("", "left");
    const bool wired = bench.configuration.strobe != Strobe::none;
    const bool slave = !bench.configuration.master.empty();
    wire::Exposure made = record(1, milliseconds(4), milliseconds(4));
    const auto agrees = [&](unsigned flags) {
        made.flags = static_cast<std::uint16_t>(flags);
        return !contradicts_itself(made, bench.configuration);
    };
    CHECK(agrees(wire::exposure_measured) == wired);
    CHECK(agrees(wire::exposure_measured | wire::exposure_from_master) == (!wired && slave));
    CHECK(agrees(wire::exposure_predicted) == (!wired && !slave));
    CHECK_FALSE(agrees(wire::exposure_no_start));
    CHECK_FALSE(agrees(wire::exposure_no_end));
    CHECK_FALSE(agrees(0));
}

TEST_CASE("exposure_validator: no field of a record overflows anything") {
    Bench bench;
    for (std::uint64_t tick = 1; tick < 20; ++tick)
        bench.believes(record(tick, milliseconds(4), milliseconds(4)));
    CHECK(rc::check("random fields", [&] {
        wire::Exposure made = record(20, milliseconds(4), milliseconds(4));
        if (*rc::gen::arbitrary<bool>()) made.trigger = *rc::gen::arbitrary<std::uint64_t>();
        if (*rc::gen::arbitrary<bool>()) made.tick = *rc::gen::arbitrary<std::uint64_t>();
        if (*rc::gen::arbitrary<bool>())
            made.trigger_ns = *rc::gen::inRange<std::int64_t>(0, std::int64_t{1} << 60);
        if (*rc::gen::arbitrary<bool>())
            made.start_ns = *rc::gen::inRange<std::int64_t>(0, std::int64_t{1} << 60);
        if (*rc::gen::arbitrary<bool>())
            made.end_ns = *rc::gen::inRange<std::int64_t>(0, std::int64_t{1} << 60);
        const wire::Exposure honest = record(20, milliseconds(4), milliseconds(4));
        const bool damaged = made.trigger != honest.trigger || made.tick != honest.tick ||
                             made.trigger_ns != honest.trigger_ns ||
                             made.start_ns != honest.start_ns || made.end_ns != honest.end_ns;
        Bench fresh = bench;
        const bool believed = fresh.believes(made);
        RC_ASSERT(believed != damaged || (believed && made.trigger == 20 && made.tick == 20));
    }));
}
