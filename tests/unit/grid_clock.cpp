// SPDX-License-Identifier: BSD-3-Clause
#include "grid_clock.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

#include "nanoseconds.hpp"

using namespace versavis::firmware;
using namespace versavis::test;

namespace {

/// True time as this board has it.
Nanoseconds board_time(Nanoseconds host, std::int64_t ppb) {
    return host + host / 1'000'000 * ppb / 1'000;
}
/// False: the pulse is not followed.
bool follows(GridClock& clock, Nanoseconds pulse) {
    return clock.sync_pulse(pulse, true).what == GridClock::Sync::followed;
}
}  // namespace

TEST_CASE("grid_clock: a line is as exact as 128 bits would be") {
    for (std::int64_t ppb = -1'899'983; ppb < 1'900'000; ppb += 19'001) {
        const GridLine line(7 * second, 3 * second, ppb);
        CHECK(line.pace_ppb() == ppb);
        const auto scaled = static_cast<__int128>(ppb) << 40;
        const __int128 pace = (scaled + (ppb < 0 ? -second : second) / 2) / second;
        for (Nanoseconds since = -600 * second; since < 600 * second; since += 7'000'000'003) {
            const __int128 gained = (since * pace + (__int128{1} << 39)) >> 40;
            REQUIRE(line.board_time(3 * second + since) ==
                    7 * second + since + static_cast<Nanoseconds>(gained));
        }
        const Nanoseconds days = 1'000'000 * second;
        const Nanoseconds off = line.board_time(3 * second + days) - 7 * second - days;
        REQUIRE(std::abs(off - ppb * 1'000'000) <= 455);
    }
    const GridLine none;
    CHECK((none.board() == 0 && none.grid() == 0 && none.pace_ppb() == 0));
    CHECK(none.board_time(100'000 * second) == 100'000 * second);
}

TEST_CASE("grid_clock: what lies before a board time is found, whatever the pace") {
    const std::int64_t ppb = GENERATE(-1'900'000, -300, 0, 1, 50'000, 1'900'000);
    const GridLine line(7 * second, 3 * second, ppb);
    for (const Nanoseconds at :
         {-100'000 * second, -second, 7 * second, 7 * second + 1, 100 * second, 100'000 * second}) {
        const Nanoseconds found = line.board_time(line.grid_time(at));
        CHECK(found <= at);
        CHECK(found >= at - std::abs(at - 7 * second) / 60'000'000 - 10);
        if (ppb == 0) CHECK(found == at);
    }
}

TEST_CASE("grid_clock: without pulses grid time passes as board time does") {
    GridClock clock;
    clock.begin(5 * second, 0);
    CHECK(clock.board_time(0) == 5 * second);
    CHECK(clock.board_time(100'000 * second) == 100'005 * second);
    CHECK_FALSE(follows(clock, 6 * second));
}

TEST_CASE(
    "grid_clock: it takes the pace of the pulses, over gaps, and refuses what is none of them") {
    GridClock clock;
    clock.begin(5 * second, second);
    CHECK(follows(clock, 6 * second + 50'000));  // 50 ppm slower than here
    CHECK(clock.board_time(second) == 6 * second + 50'000);
    CHECK(clock.board_time(second + second / 2) == 6 * second + second / 2 + 75'000);
    CHECK_FALSE(follows(clock, 6 * second + 700'000'000));
    CHECK(follows(clock, 9 * second + 200'000));
    CHECK(clock.board_time(4 * second) == 9 * second + 200'000);
    CHECK(clock.board_time(5 * second) == 10 * second + 250'000);
}

TEST_CASE(
    "grid_clock: placed, its nearest second is there at once, and the pace holds from there") {
    for (const Nanoseconds wanted :
         {107'400'000'000, 107'600'000'000, 5'499'999'999, 4'200'000'000}) {
        GridClock clock;
        clock.begin(5 * second, 0);
        const Nanoseconds before = clock.grid_time(wanted);
        clock.place(wanted, 30'000);
        const Nanoseconds whole = std::lround(static_cast<double>(before) / 1e9) * second;
        CHECK(std::abs(whole - before) <= second / 2);
        CHECK(clock.board_time(whole) == wanted);
        CHECK(clock.board_time(whole + 10 * second) == wanted + 10 * second + 300'000);
        CHECK(clock.board_time(whole - second) == wanted - second - 30'000);
    }
}

TEST_CASE(
    "grid_clock: aligned, it slews within its limit, never steps, and arrives to the nanosecond") {
    const std::int64_t pace = GENERATE(-500'000, -40'017, 0, 25'123, 500'000);
    const std::uint32_t slew = GENERATE(100U, 20'000U, 1'000'000U);
    const Nanoseconds offset = GENERATE(-498'000'000, -3'000, 0, 1, 47'000'000, 498'000'000);
    GridClock clock;
    clock.begin(5 * second, 0);
    const Nanoseconds now = 42 * second + 123'456'789;
    const Nanoseconds wanted = 43 * second + offset;
    clock.align(wanted, static_cast<std::int32_t>(pace), slew, now);
    CHECK(std::abs(clock.board_time(clock.grid_time(now)) - now) < 20);
    // Ticks of 100 ms: each is within the limit of the pace after the one before, which roundings
    // may miss by 2 ns.
    const Nanoseconds step = 100'000'000;
    Nanoseconds grid = clock.grid_time(now);
    Nanoseconds before = clock.board_time(grid);
    // Until the second that is named, a pace of 500 ppm makes up to 0.5 ms more.
    const std::int64_t arrives = (std::llabs(offset) + 500'000) / slew + 3;
    const std::int64_t ticks = std::min<std::int64_t>(arrives * 11, 20'000);
    for (std::int64_t i = 0; i < ticks; ++i) {
        grid += step;
        const Nanoseconds at = clock.board_time(grid);
        const double beyond =
            static_cast<double>(at - before - step) - static_cast<double>(pace) * 1e-1;
        REQUIRE(std::abs(beyond) <= static_cast<double>(slew) * 1e-1 + 2);
        REQUIRE(at > before);
        before = at;
    }
    if (ticks < arrives * 11) return;  // the limit keeps it from arriving soon
    const Nanoseconds later = 38 * second + (grid / second - 37) * second;
    const double line = static_cast<double>(wanted) + static_cast<double>(later - 38 * second) *
                                                          (1 + 1e-9 * static_cast<double>(pace));
    CHECK(std::abs(static_cast<double>(clock.board_time(later)) - line) <= 1);
}

TEST_CASE("grid_clock: messages once a second from a true clock keep it there to a nanosecond") {
    const std::int64_t ppb = GENERATE(-60'000, 35'000);
    GridClock clock;
    clock.begin(board_time(300'000'000, ppb), 0);
    Nanoseconds newest = 0;
    std::uint64_t tick = 0;
    for (std::int64_t host_s = 1; host_s < 2000; ++host_s) {
        // The message comes some 0.3 s before the second that it names.
        const Nanoseconds now = board_time(host_s * second - 300'000'000 - host_s * 100'000, ppb);
        const Nanoseconds meets = clock.grid_time(now);
        const Nanoseconds met_before = clock.board_time(meets);
        clock.align(board_time(host_s * second, ppb), static_cast<std::int32_t>(ppb), 500'000, now);
        REQUIRE(clock.board_time(meets) == met_before);
        for (; clock.board_time(static_cast<Nanoseconds>(tick) * 50'000'000) <
               board_time(host_s * second, ppb);
             ++tick) {
            const Nanoseconds at = clock.board_time(static_cast<Nanoseconds>(tick) * 50'000'000);
            REQUIRE(at > newest);
            newest = at;
        }
    }
    // 0.3 s at 500 ppm takes 600 s.
    for (std::int64_t host_s = 1'999; host_s < 2'010; ++host_s)
        CHECK(std::abs(clock.misplaced(board_time(host_s * second, ppb))) <= 1);
}

TEST_CASE("grid_clock: the newer of host and sync pulses is followed") {
    GridClock clock;
    clock.begin(5 * second, second);
    CHECK(follows(clock, 6 * second + 50'000));
    clock.align(7 * second, 0, 1'000'000, 6 * second + 100'000'000);
    CHECK_FALSE(follows(clock, 7 * second + 100'000));
    CHECK(clock.board_time(3 * second) == 8 * second);
    clock.begin(9 * second, second);
    CHECK(clock.board_time(second) == 10 * second);
    CHECK(follows(clock, 10 * second + 50'000));
}

TEST_CASE("grid_clock: a sender that went on at another pace, or began anew, is followed again") {
    using Sync = GridClock::Sync;
    const Nanoseconds jump = GENERATE(150'000, 300'000'000, -250'000'000);
    const bool running = GENERATE(true, false);
    GridClock clock;
    clock.begin(5 * second, second);
    REQUIRE(follows(clock, 6 * second + 20'000));
    REQUIRE(follows(clock, 7 * second + 40'000));
    CHECK(clock.sync_state(8 * second) == versavis::wire::SyncState::followed);
    CHECK(clock.sync_state(18 * second) == versavis::wire::SyncState::lost);
    const auto pulse = [jump](int n) {
        return 300 * second + 6'000'000 + jump + n * (second + 500);
    };
    const GridClock::SyncPulse first = clock.sync_pulse(pulse(0), running);
    CHECK(first.what == Sync::lost);
    CHECK(clock.sync_state(pulse(0)) == versavis::wire::SyncState::lost);
    CHECK(clock.sync_pulse(pulse(1), running).what == Sync::ignored);
    const Nanoseconds before = clock.board_time(clock.grid_time(pulse(2)));
    const GridClock::SyncPulse taken = clock.sync_pulse(pulse(2), running);
    CHECK(taken.what == Sync::taken);
    const Nanoseconds there = (clock.grid_time(pulse(3)) + second / 2) / second * second;
    if (!running) CHECK(std::abs(clock.board_time(there) - pulse(3)) < 10);
    CHECK(clock.sync_state(pulse(2)) ==
          (running ? versavis::wire::SyncState::lost : versavis::wire::SyncState::followed));
    if (running) CHECK(std::abs(clock.board_time(clock.grid_time(pulse(2))) - before) < 4'000);
    for (int n = 3; n < 400; ++n) REQUIRE(follows(clock, pulse(n)));
    // There, at last: its pulses lie on whole seconds.
    CHECK(clock.sync_state(pulse(400)) == versavis::wire::SyncState::followed);
    const Nanoseconds whole = (clock.grid_time(pulse(400)) + second / 2) / second * second;
    CHECK(std::abs(clock.board_time(whole) - pulse(400)) < 10);
}

TEST_CASE("grid_clock: noise between the pulses of a sender is no other sender, however regular") {
    const Nanoseconds drift = GENERATE(0, 7'000'000);
    GridClock clock;
    clock.begin(5 * second, second);
    for (int n = 1; n < 100; ++n) {
        REQUIRE(follows(clock, (5 + n) * second));
        const Nanoseconds noise = (5 + n) * second + 100'000'000 + n * drift;
        REQUIRE(clock.sync_pulse(noise, true).what != GridClock::Sync::taken);
    }
}

TEST_CASE("grid_clock: before the pace is known, pulses may be off by 500 ppm, after that by 50") {
    const Nanoseconds sign = GENERATE(1, -1);
    const auto [periods, most] =
        GENERATE(table<Nanoseconds, Nanoseconds>({{1, 500'000}, {4, 2'000'000}, {5, 500'000}}));
    CAPTURE(sign, periods);
    for (const Nanoseconds beyond : {0, 1}) {
        GridClock clock;
        clock.begin(5 * second, second);
        const Nanoseconds off = sign * (most + beyond);
        const auto pulse = clock.sync_pulse((5 + periods) * second + off, true);
        CHECK(pulse.what == (beyond == 0 ? GridClock::Sync::followed : GridClock::Sync::lost));
        CHECK(pulse.off == off);

        GridClock known;
        known.begin(5 * second, second);
        REQUIRE(follows(known, 6 * second));
        const Nanoseconds next = (6 + periods) * second + sign * (50'000 + beyond);
        CHECK(follows(known, next) == (beyond == 0));
        if (beyond == 0) CHECK(known.board_time((1 + periods) * second) == next);
    }
}

TEST_CASE("grid_clock: a pulse at or before the origin is none of the grid's") {
    for (const Nanoseconds at : {5 * second, 4 * second}) {
        GridClock clock;
        clock.begin(5 * second, second);
        CHECK(clock.sync_pulse(at, true).what == GridClock::Sync::lost);
    }
    // Three of them are a sender: also grid times before the origin are multiples of its period.
    GridClock clock;
    clock.begin(5'300'000'000, second);
    clock.sync_pulse(second, false);
    clock.sync_pulse(2 * second, false);
    const auto taken = clock.sync_pulse(3 * second, false);
    CHECK(taken.what == GridClock::Sync::taken);
    CHECK(taken.off == -300'000'000);
    CHECK(clock.board_time(-2 * second) == 3 * second);
    CHECK(clock.board_time(0) == 5 * second);
}

TEST_CASE("grid_clock: after ten periods without a pulse the sender is lost") {
    using versavis::wire::SyncState;
    GridClock clock;
    CHECK(clock.sync_state(0) == SyncState::none);
    CHECK(clock.sync_pulse(second, true).off == 0);
    CHECK(clock.board_time(77) == 77);
    clock.begin(5 * second, second);
    CHECK(clock.sync_state(15 * second) == SyncState::followed);
    CHECK(clock.sync_state(15 * second + 1) == SyncState::lost);
    REQUIRE(follows(clock, 6 * second));
    CHECK(clock.sync_state(16 * second) == SyncState::followed);
    CHECK(clock.sync_state(16 * second + 1) == SyncState::lost);
    clock.sync_pulse(7 * second + 300'000'000, true);
    CHECK(clock.sync_state(8 * second) == SyncState::lost);
    REQUIRE(follows(clock, 8 * second));
    CHECK(clock.sync_state(8 * second) == SyncState::followed);
}

TEST_CASE("grid_clock: while it goes to a new sender it runs 1000 ppm off its pace, then steps") {
    const Nanoseconds jump = GENERATE(200'000'000, -200'000'000);
    const Nanoseconds slew = jump < 0 ? -1'000'000 : 1'000'000;
    GridClock clock;
    clock.begin(5 * second, second);
    REQUIRE(follows(clock, 6 * second));
    const auto pulse = [jump](int n) { return (100 + n) * second + jump; };
    CHECK(clock.sync_pulse(pulse(0), true).off == jump);
    CHECK(clock.sync_pulse(pulse(1), true).off == jump);
    CHECK(clock.sync_pulse(pulse(2), true).off == jump);
    int n = 3;
    for (; n < 190; ++n) {
        const Nanoseconds grid = (93 + n) * second + second / 2;
        REQUIRE(std::abs(clock.board_time(grid + second) - clock.board_time(grid) - second -
                         slew) <= 2);
        const Nanoseconds now = clock.grid_time(pulse(n));
        const Nanoseconds before = clock.board_time(now);
        REQUIRE(follows(clock, pulse(n)));
        REQUIRE(std::abs(clock.board_time(now) - before) <= 1);
    }
    for (; n < 220; ++n) REQUIRE(follows(clock, pulse(n)));
    REQUIRE(follows(clock, pulse(n) + 30'000));
    CHECK(clock.board_time((95 + n) * second) == pulse(n) + 30'000);
    CHECK(std::abs(clock.board_time(clock.grid_time(pulse(n))) - pulse(n)) < 100);
}

TEST_CASE("grid_clock: pulses that come a little later on the way to them make no step") {
    GridClock clock;
    clock.begin(5 * second, second);
    Nanoseconds grid = 0;
    Nanoseconds before = clock.board_time(grid);
    for (int n = 0; n < 250; ++n) {
        const Nanoseconds pulse = (6 + n) * second + 200'000'000 + (n < 10 ? 0 : 30'000);
        for (; clock.board_time(grid + 10'000'000) < pulse; before = clock.board_time(grid)) {
            grid += 10'000'000;
            REQUIRE(std::abs(clock.board_time(grid) - before - 10'000'000) <= 10'310);
        }
        clock.sync_pulse(pulse, true);
    }
}

TEST_CASE("grid_clock: a sender that was just taken must be kept, like any other") {
    GridClock clock;
    clock.begin(5 * second, second);
    for (int n = 0; n < 3; ++n) clock.sync_pulse((6 + n) * second + 300'000'000, false);
    CHECK(clock.board_time(4 * second) == 8 * second + 300'000'000);
    CHECK(clock.sync_pulse(9 * second + 300'200'000, false).what == GridClock::Sync::lost);
    CHECK(follows(clock, 10 * second + 300'000'000));
}

TEST_CASE("grid_clock: it goes to a new sender by the shortest way, or onwards where none runs") {
    const bool running = GENERATE(false, true);
    for (const Nanoseconds phase : {100, 400, 499, 500, 501, 600, 900}) {
        GridClock clock;
        clock.begin(5 * second, second);
        GridClock::SyncPulse pulse;
        for (int n = 0; n < 3; ++n)
            pulse = clock.sync_pulse((8 + n) * second + phase * 1'000'000, running);
        CHECK(pulse.what == GridClock::Sync::taken);
        CHECK(pulse.off == (running && phase < 500 ? phase : phase - 1000) * 1'000'000);
    }
}

TEST_CASE("grid_clock: taken while no camera runs, it is there at once, whatever went before") {
    GridClock clock;
    clock.begin(5 * second, second);
    for (int n = 0; n < 3; ++n) clock.sync_pulse((6 + n) * second + 300'000'000, true);
    for (int n = 0; n < 3; ++n) clock.sync_pulse((20 + n) * second + 700'000'000, false);
    const Nanoseconds newest = 22 * second + 700'000'000;
    const Nanoseconds whole = (clock.grid_time(newest) + second / 2) / second * second;
    CHECK(clock.board_time(whole) == newest);
    CHECK(clock.board_time(whole + second) == newest + second);
}

TEST_CASE("grid_clock: placed while it slews, it is there at once, and follows no pulses") {
    GridClock clock;
    clock.begin(5 * second, second);
    clock.align(10'400'000'000, 0, 1'000'000, 9 * second);
    CHECK(std::abs(clock.board_time(6 * second) - 11 * second) < 3'000'000);
    CHECK(clock.sync_state(9 * second) == versavis::wire::SyncState::none);
    clock.begin(5 * second, second);
    clock.align(10'400'000'000, 0, 1'000'000, 9 * second);
    clock.place(10'300'000'000, 0);
    CHECK(clock.board_time(5 * second) == 10'300'000'000);
    CHECK(clock.board_time(6 * second) == 11'300'000'000);
    clock.begin(5 * second, second);
    clock.place(10'300'000'000, 0);
    CHECK_FALSE(follows(clock, 11'300'000'000));
    CHECK(clock.sync_state(11 * second) == versavis::wire::SyncState::none);
}

TEST_CASE("grid_clock: how far a second is from its grid point") {
    GridClock clock;
    clock.begin(5 * second, 0);
    CHECK(clock.misplaced(107'400'000'000) == 400'000'000);
    CHECK(clock.misplaced(107'500'000'000) == -500'000'000);
    CHECK(clock.misplaced(107'600'000'000) == -400'000'000);
    CHECK(clock.misplaced(4'200'000'000) == 200'000'000);
    CHECK(clock.misplaced(4'600'000'000) == -400'000'000);
    CHECK(clock.misplaced(2'000'000'000) == 0);
}
