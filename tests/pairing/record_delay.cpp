// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/record_delay.hpp"

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

RecordDelay delays_after(std::uint64_t records) {
    RecordDelay delays{Limits{}};
    for (std::uint64_t i = 1; i <= records; ++i) {
        REQUIRE_FALSE(delays.too_early(record(i, i)));
        delays.take(record(i, i));
    }
    return delays;
}

}  // namespace

TEST_CASE(
    "record_delay: no record comes before its exposure, nor much sooner after it than others") {
    RecordDelay delays = delays_after(1);
    Exposure early = record(2, 2);
    early.recorded = early.earliest_on_host - milliseconds(6);
    CHECK(delays.too_early(early));
    // A grid that goes by a time which was set forward.
    Exposure ahead = record(6, 7);
    ahead.recorded = ahead.recorded - milliseconds(50);
    CHECK(delays_after(5).too_early(ahead));
}

TEST_CASE(
    "record_delay: after a stall, only an exposure since its end shows that the link has caught "
    "up") {
    RecordDelay delays = delays_after(5);
    CHECK(delays.live());
    const HostTime stall_ends = record(10, 10).recorded + milliseconds(45);
    for (std::uint64_t i = 6; i <= 10; ++i) {
        Exposure held_up = record(i, i);
        held_up.recorded = stall_ends;
        delays.take(held_up);
        CHECK_FALSE(delays.live());
    }
    // Of a board whose time was set forward by a period meanwhile: it seems to come promptly.
    Exposure seems_prompt = shifted(record(11, 11), milliseconds(-4));
    seems_prompt.recorded = stall_ends;
    REQUIRE_FALSE(delays.too_early(seems_prompt));
    RecordDelay deceived = delays;
    deceived.take(seems_prompt);
    CHECK_FALSE(deceived.live());
    delays.take(record(12, 12));
    CHECK(delays.live());
}

TEST_CASE("record_delay: records that come late are good, but not prompt") {
    RecordDelay delays = delays_after(5);
    CHECK(delays.prompt());
    Exposure late = record(6, 6);
    late.recorded = late.recorded + milliseconds(50);
    REQUIRE_FALSE(delays.too_early(late));
    delays.take(late);
    CHECK_FALSE(delays.prompt());
    delays.take(record(7, 7));
    CHECK(delays.prompt());
}

TEST_CASE("record_delay: once four records agree, one much sooner than they is too early") {
    for (const std::uint64_t records : {3U, 4U})
        for (const auto& [sooner, good] : {std::pair{microseconds(1'000), true},
                                           {microseconds(5'499), true},
                                           {microseconds(5'501), false}}) {
            const RecordDelay delays = delays_after(records);
            Exposure next = record(records + 1, records + 1);
            next.recorded = next.recorded - sooner;
            CHECK(!delays.too_early(next) == good);  // 5 ms before its end is the limit in any case
        }
    Limits limits;
    limits.earliest_arrival = -seconds(1);
    for (const std::uint64_t records : {3U, 4U})
        for (const auto& [sooner, good] :
             {std::pair{microseconds(12'490), true}, {microseconds(12'510), false}}) {
            RecordDelay delays(limits);
            for (std::uint64_t i = 1; i <= records; ++i) delays.take(record(i, i));
            Exposure next = record(records + 1, records + 1);
            next.recorded = next.recorded - sooner;
            CHECK(!delays.too_early(next) == (good || records == 3));
        }
}

TEST_CASE("record_delay: a record that does not say when it came is never too early, nor late") {
    RecordDelay delays = delays_after(5);
    for (std::uint64_t i = 6; i < 12; ++i) {
        Exposure unknown = record(i, i);
        unknown.recorded = {};
        CHECK_FALSE(delays.too_early(unknown));
        delays.take(unknown);
        CHECK(delays.prompt());
    }
}

TEST_CASE(
    "record_delay: prompt is a quarter of a period after the quickest, and within the limits") {
    for (const auto& [late, prompt] :
         {std::pair{microseconds(12'490), true}, {microseconds(12'560), false}}) {
        RecordDelay delays = delays_after(5);
        Exposure next = record(6, 6);
        next.recorded = next.recorded + late;
        delays.take(next);
        CHECK(delays.prompt() == prompt);
    }
    Limits limits;
    limits.exposure_wait = milliseconds(3);
    for (const auto& [delay, prompt] :
         {std::pair{milliseconds(3), true}, {milliseconds(3) + nanoseconds(1), false}}) {
        RecordDelay delays(limits);
        for (std::uint64_t i = 1; i < 6; ++i) delays.take(record(i, i));
        Exposure next = record(6, 6);
        next.recorded = next.earliest_on_host + delay;
        delays.take(next);
        CHECK(delays.prompt() == prompt);
    }
}

TEST_CASE("record_delay: how soon records come is learned anew when that is asked") {
    RecordDelay delays = delays_after(8);
    Exposure early = record(9, 9);
    early.recorded = early.earliest_on_host - milliseconds(4);
    Exposure slow = record(9, 9);
    slow.recorded = slow.recorded + milliseconds(40);
    CHECK_FALSE(delays.too_early(slow));
    delays.forget();
    CHECK(!delays.too_early(early));  // by the limits alone
    delays.take(slow);
    CHECK(delays.prompt());  // nobody knows of quicker ones
}

TEST_CASE("record_delay: the first record of all is prompt, but the link may have stalled") {
    RecordDelay delays{Limits{}};
    CHECK(delays.live());
    CHECK(delays.prompt());
    delays.take(record(1, 1));
    CHECK(delays.prompt());
    CHECK_FALSE(delays.live());
    delays.take(record(2, 2));
    CHECK(delays.live());
}

TEST_CASE("record_delay: a record that does not say when it came teaches nothing of others") {
    RecordDelay delays = delays_after(4);
    Exposure silent = record(5, 5);
    silent.recorded = {};
    delays.take(silent);
    Exposure soon = record(6, 6);
    soon.recorded = soon.earliest_on_host - milliseconds(13);
    CHECK(delays.too_early(soon));
}

TEST_CASE("record_delay: a silent line is reported late, and says nothing about the link") {
    RecordDelay delays = delays_after(5);
    Exposure silent = record(6, 6);
    silent.exposed = false;
    silent.recorded = silent.recorded + milliseconds(50);
    delays.take(silent);
    CHECK(delays.live());
    CHECK(delays.prompt());
    // A late record is followed by one of a silent line: the link may still hold records up.
    Exposure late = record(7, 7);
    late.recorded = late.recorded + milliseconds(50);
    delays.take(late);
    silent = record(8, 8);
    silent.exposed = false;
    silent.recorded = silent.recorded + milliseconds(50);
    delays.take(silent);
    CHECK_FALSE(delays.live());
    delays.take(record(9, 9));
    CHECK(delays.live());
}

TEST_CASE("record_delay: one that comes much sooner is believed when four agree with it") {
    const auto after = [](std::uint64_t quick) {
        RecordDelay delays{Limits{}};
        for (std::uint64_t i = 1; i <= 3 + quick; ++i) {
            Exposure one = record(i, i);
            one.recorded = one.earliest_on_host + milliseconds(i <= 3 ? 45 : 15);
            delays.take(one);
        }
        Exposure soon = record(9, 9);
        soon.recorded = soon.earliest_on_host;
        return !delays.too_early(soon);
    };
    CHECK(after(4));
    CHECK_FALSE(after(5));
}

TEST_CASE("record_delay: after what was learned is forgotten, four records have to agree again") {
    RecordDelay delays = delays_after(6);
    delays.forget();
    const auto soon = [&](std::uint64_t i) {
        Exposure one = record(i, i);
        one.recorded = one.earliest_on_host - milliseconds(4);
        return one;
    };
    for (std::uint64_t i = 7; i <= 9; ++i) {
        Exposure one = record(i, i);
        one.recorded = one.earliest_on_host + milliseconds(30);
        delays.take(one);
        CHECK_FALSE(delays.too_early(soon(10)));
    }
    Exposure one = record(10, 10);
    one.recorded = one.earliest_on_host + milliseconds(30);
    delays.take(one);
    CHECK(delays.too_early(soon(11)));
}

namespace {

/// Two exchanges with the board's clock for each record, of which each comes `late`.
void take_late(RecordDelay& delays, std::uint64_t trigger, Duration late, bool agree = true) {
    delays.compared(2 * trigger, agree);
    Exposure next = record(trigger, trigger);
    next.recorded = next.recorded + late;
    REQUIRE_FALSE(delays.too_early(next));
    delays.take(next);
}

}  // namespace

TEST_CASE("record_delay: a link that became slower is believed once exchanges agree with it") {
    for (const Duration late : {milliseconds(15), milliseconds(30), milliseconds(45)}) {
        RecordDelay delays = delays_after(5);
        for (std::uint64_t i = 6; i <= 11; ++i) {
            take_late(delays, i, late);
            CHECK_FALSE(delays.live());
            CHECK_FALSE(delays.prompt());
            CHECK(absolute(delays.late_by() - late) < milliseconds(1));
        }
        for (std::uint64_t i = 12; i <= 13; ++i) take_late(delays, i, late);
        CHECK(delays.live());
        CHECK(delays.prompt());
        CHECK(delays.late_by() == Duration{});
        // It may be as quick again as ever, and as slow again only after the same proof.
        take_late(delays, 14, {});
        CHECK(delays.live());
        take_late(delays, 15, late);
        CHECK_FALSE(delays.live());
    }
}

TEST_CASE("record_delay: late records are not believed without exchanges, nor against them") {
    RecordDelay delays = delays_after(5);
    for (std::uint64_t i = 6; i <= 40; ++i) {
        Exposure late = record(i, i);
        late.recorded = late.recorded + milliseconds(45);
        delays.take(late);
        CHECK_FALSE(delays.live());
    }
    for (std::uint64_t i = 41; i <= 80; ++i) {
        take_late(delays, i, milliseconds(45), i % 5 != 0);
        CHECK_FALSE(delays.live());
    }
    // Later than a frame waits is too late, whatever the exchanges say.
    RecordDelay useless = delays_after(5);
    for (std::uint64_t i = 6; i <= 40; ++i) take_late(useless, i, milliseconds(600));
    CHECK_FALSE(useless.live());
}
