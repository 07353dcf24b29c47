// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/record_gate.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::pairing;

namespace {

/// Of a camera at 20 Hz, as good as records are.
Exposure record(std::uint64_t trigger, std::uint64_t tick) {
    Exposure exposure;
    exposure.trigger = trigger;
    exposure.tick = tick;
    exposure.start = BoardTime{static_cast<std::int64_t>(tick) * 50'000'000};
    exposure.end = exposure.start + milliseconds(2);
    exposure.end_on_host = exposure.earliest_on_host = HostTime{exposure.end.ns + 7'000'000'000};
    exposure.recorded = exposure.end_on_host + microseconds(500);
    return exposure;
}

Exposure shifted(Exposure exposure, Duration by) {
    exposure.start = exposure.start + by;
    exposure.end = exposure.end + by;
    exposure.end_on_host = exposure.earliest_on_host = exposure.end_on_host + by;
    return exposure;
}

RecordGate gate_after(std::uint64_t records) {
    RecordGate gate{Limits{}};
    for (std::uint64_t i = 1; i <= records; ++i) {
        REQUIRE(gate.accepts(record(i, i)));
        gate.take(record(i, i));
    }
    return gate;
}

}  // namespace

TEST_CASE(
    "record_gate: grid points may be left out, and exposures may begin earlier as they grow") {
    const RecordGate gate = gate_after(5);
    CHECK(gate.accepts(record(6, 6)));
    CHECK(gate.accepts(record(6, 26)));
    CHECK(gate.accepts(record(8, 8)));
    CHECK(gate.accepts(shifted(record(6, 6), -milliseconds(24))));
}

TEST_CASE("record_gate: a start that is off its grid point is refused, however far") {
    const RecordGate gate = gate_after(5);
    const Duration off = GENERATE(milliseconds(-1'000'000), milliseconds(-50), milliseconds(50),
                                  milliseconds(100), Duration{std::int64_t{1} << 32U},
                                  Duration{INT64_MAX / 2}, Duration{-(INT64_MAX / 2)});
    CHECK_FALSE(gate.accepts(shifted(record(6, 6), off)));
}

TEST_CASE("record_gate: numbers grow, and no faster than the grid") {
    const RecordGate gate = gate_after(5);
    CHECK_FALSE(gate.accepts(record(1006, 6)));
    CHECK_FALSE(gate.accepts(record(5, 6)));
    CHECK_FALSE(gate.accepts(record(6, 5)));
}

TEST_CASE(
    "record_gate: no record comes before its exposure, nor much sooner after it than others") {
    RecordGate gate = gate_after(1);
    Exposure early = record(2, 2);
    early.recorded = early.earliest_on_host - milliseconds(6);
    CHECK_FALSE(gate.accepts(early));
    // A grid that goes by a time which was set forward.
    Exposure ahead = record(6, 7);
    ahead.recorded = ahead.recorded - milliseconds(50);
    CHECK_FALSE(gate_after(5).accepts(ahead));
}

TEST_CASE(
    "record_gate: after a stall, only an exposure since its end shows that the link has caught "
    "up") {
    RecordGate gate = gate_after(5);
    CHECK(gate.live());
    const HostTime stall_ends = record(10, 10).recorded + milliseconds(45);
    for (std::uint64_t i = 6; i <= 10; ++i) {
        Exposure held_up = record(i, i);
        held_up.recorded = stall_ends;
        gate.take(held_up);
        CHECK_FALSE(gate.live());
    }
    // Of a board whose time was set forward by a period meanwhile: it seems to come promptly.
    Exposure seems_prompt = shifted(record(11, 11), milliseconds(-4));
    seems_prompt.recorded = stall_ends;
    REQUIRE(gate.accepts(seems_prompt));
    RecordGate deceived = gate;
    deceived.take(seems_prompt);
    CHECK_FALSE(deceived.live());
    gate.take(record(12, 12));
    CHECK(gate.live());
}

TEST_CASE("record_gate: records that come late are good, but not prompt") {
    RecordGate gate = gate_after(5);
    CHECK(gate.prompt());
    Exposure late = record(6, 6);
    late.recorded = late.recorded + milliseconds(50);
    REQUIRE(gate.accepts(late));
    gate.take(late);
    CHECK_FALSE(gate.prompt());
    gate.take(record(7, 7));
    CHECK(gate.prompt());
}
