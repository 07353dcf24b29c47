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

TEST_CASE("record_gate: how far a start may lie off its grid point, by distance") {
    // 0.6 periods, and 2 ms for each second since the record before.
    for (const std::uint64_t steps : {1U, 20U}) {
        const Duration limit = milliseconds(30) + microseconds(100) * static_cast<int>(steps);
        for (const int side : {-1, 1}) {
            const RecordGate gate{Limits{}};
            const auto fits = [&](Duration off) {
                return gate.in_order(record(1, 1), shifted(record(2, 1 + steps), off * side));
            };
            CHECK(fits(limit - nanoseconds(1)));
            CHECK_FALSE(fits(limit + nanoseconds(1)));
        }
    }
    const RecordGate gate = gate_after(5);
    CHECK(gate.in_order(record(5, 5), record(6, 6)));
    CHECK_FALSE(gate.in_order(record(5, 5), record(7, 6)));
    CHECK_FALSE(gate.in_order(record(5, 5), record(5, 5)));
}

TEST_CASE("record_gate: once four records agree, one much sooner than they is too early") {
    for (const std::uint64_t records : {3U, 4U})
        for (const auto& [sooner, good] : {std::pair{microseconds(1'000), true},
                                           {microseconds(5'499), true},
                                           {microseconds(5'501), false}}) {
            const RecordGate gate = gate_after(records);
            Exposure next = record(records + 1, records + 1);
            next.recorded = next.recorded - sooner;
            CHECK(gate.accepts(next) == good);  // 5 ms before its end is the limit in any case
        }
    Limits limits;
    limits.earliest_arrival = -seconds(1);
    for (const std::uint64_t records : {3U, 4U})
        for (const auto& [sooner, good] :
             {std::pair{microseconds(12'490), true}, {microseconds(12'510), false}}) {
            RecordGate gate(limits);
            for (std::uint64_t i = 1; i <= records; ++i) gate.take(record(i, i));
            Exposure next = record(records + 1, records + 1);
            next.recorded = next.recorded - sooner;
            CHECK(gate.accepts(next) == (good || records == 3));
        }
}

TEST_CASE("record_gate: a record that does not say when it came is never too early, nor late") {
    RecordGate gate = gate_after(5);
    for (std::uint64_t i = 6; i < 12; ++i) {
        Exposure unknown = record(i, i);
        unknown.recorded = {};
        CHECK(gate.accepts(unknown));
        gate.take(unknown);
        CHECK(gate.prompt());
    }
}

TEST_CASE(
    "record_gate: prompt is a quarter of a period after the quickest, and within the limits") {
    for (const auto& [late, prompt] :
         {std::pair{microseconds(12'490), true}, {microseconds(12'560), false}}) {
        RecordGate gate = gate_after(5);
        Exposure next = record(6, 6);
        next.recorded = next.recorded + late;
        gate.take(next);
        CHECK(gate.prompt() == prompt);
    }
    Limits limits;
    limits.exposure_wait = milliseconds(3);
    for (const auto& [delay, prompt] :
         {std::pair{milliseconds(3), true}, {milliseconds(3) + nanoseconds(1), false}}) {
        RecordGate gate(limits);
        for (std::uint64_t i = 1; i < 6; ++i) gate.take(record(i, i));
        Exposure next = record(6, 6);
        next.recorded = next.earliest_on_host + delay;
        gate.take(next);
        CHECK(gate.prompt() == prompt);
    }
}

TEST_CASE("record_gate: how soon records come is learned anew when that is asked") {
    RecordGate gate = gate_after(8);
    Exposure early = record(9, 9);
    early.recorded = early.earliest_on_host - milliseconds(4);
    Exposure slow = record(9, 9);
    slow.recorded = slow.recorded + milliseconds(40);
    CHECK(gate.accepts(slow));
    gate.forget_delay();
    CHECK(gate.accepts(early));  // by the limits alone
    gate.take(slow);
    CHECK(gate.prompt());  // nobody knows of quicker ones
}

TEST_CASE("record_gate: the first record of all is prompt, but the link may have stalled") {
    RecordGate gate{Limits{}};
    CHECK(gate.live());
    CHECK(gate.prompt());
    gate.take(record(1, 1));
    CHECK(gate.prompt());
    CHECK_FALSE(gate.live());
    gate.take(record(2, 2));
    CHECK(gate.live());
}

TEST_CASE("record_gate: a record that does not say when it came teaches nothing of others") {
    RecordGate gate = gate_after(4);
    Exposure silent = record(5, 5);
    silent.recorded = {};
    gate.take(silent);
    Exposure soon = record(6, 6);
    soon.recorded = soon.earliest_on_host - milliseconds(13);
    CHECK_FALSE(gate.accepts(soon));
}

TEST_CASE("record_gate: a silent line is reported late, and says nothing about the link") {
    RecordGate gate = gate_after(5);
    Exposure silent = record(6, 6);
    silent.exposed = false;
    silent.recorded = silent.recorded + milliseconds(50);
    gate.take(silent);
    CHECK(gate.live());
    CHECK(gate.prompt());
    // A late record is followed by one of a silent line: the link may still hold records up.
    Exposure late = record(7, 7);
    late.recorded = late.recorded + milliseconds(50);
    gate.take(late);
    silent = record(8, 8);
    silent.exposed = false;
    silent.recorded = silent.recorded + milliseconds(50);
    gate.take(silent);
    CHECK_FALSE(gate.live());
    gate.take(record(9, 9));
    CHECK(gate.live());
}

TEST_CASE("record_gate: one that comes much sooner is believed when four agree with it") {
    const auto after = [](std::uint64_t quick) {
        RecordGate gate{Limits{}};
        for (std::uint64_t i = 1; i <= 3 + quick; ++i) {
            Exposure one = record(i, i);
            one.recorded = one.earliest_on_host + milliseconds(i <= 3 ? 45 : 15);
            gate.take(one);
        }
        Exposure soon = record(9, 9);
        soon.recorded = soon.earliest_on_host;
        return gate.accepts(soon);
    };
    CHECK(after(4));
    CHECK_FALSE(after(5));
}

TEST_CASE("record_gate: after what was learned is forgotten, four records have to agree again") {
    RecordGate gate = gate_after(6);
    gate.forget_delay();
    const auto soon = [&](std::uint64_t i) {
        Exposure one = record(i, i);
        one.recorded = one.earliest_on_host - milliseconds(4);
        return one;
    };
    for (std::uint64_t i = 7; i <= 9; ++i) {
        Exposure one = record(i, i);
        one.recorded = one.earliest_on_host + milliseconds(30);
        gate.take(one);
        CHECK(gate.accepts(soon(10)));
    }
    Exposure one = record(10, 10);
    one.recorded = one.earliest_on_host + milliseconds(30);
    gate.take(one);
    CHECK_FALSE(gate.accepts(soon(11)));
}
