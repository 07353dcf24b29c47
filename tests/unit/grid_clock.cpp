// SPDX-License-Identifier: BSD-3-Clause
#include "grid_clock.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

using namespace versavis::firmware;

namespace {
constexpr Nanoseconds second = 1'000'000'000;

/// True time as this board has it.
Nanoseconds board_time(Nanoseconds host, std::int64_t ppb) {
    return host + host / 1'000'000 * ppb / 1'000;
}
/// False: the pulse is not followed.
bool follows(GridClock& clock, Nanoseconds pulse) {
    return clock.sync_pulse(pulse, true).what == GridClock::Sync::followed;
}
}  // namespace

TEST_CASE("grid_clock: what lies before a board time is found, whatever the pace") {
    GridClock clock;
    clock.begin(5 * second, second);
    REQUIRE(follows(clock, 6 * second + 300'000));
    for (const Nanoseconds at : {6 * second, 100 * second, 100'000 * second}) {
        CHECK(clock.board_time(clock.grid_time(at)) <= at);
        CHECK(clock.board_time(clock.grid_time(at)) >= at - at / 500'000 - 10);
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
    // Ticks of 10 ms: each is within the limit of the pace after the one before, which roundings
    // may miss by 2 ns.
    const Nanoseconds step = 10'000'000;
    Nanoseconds grid = clock.grid_time(now);
    Nanoseconds before = clock.board_time(grid);
    // Until the second that is named, a pace of 500 ppm makes up to 0.5 ms more.
    const std::int64_t arrives = (std::llabs(offset) + 500'000) / slew + 3;
    const std::int64_t ticks = std::min<std::int64_t>(arrives * 110, 200'000);
    for (std::int64_t i = 0; i < ticks; ++i) {
        grid += step;
        const Nanoseconds at = clock.board_time(grid);
        const double beyond =
            static_cast<double>(at - before - step) - static_cast<double>(pace) * 1e-2;
        REQUIRE(std::abs(beyond) <= static_cast<double>(slew) * 1e-2 + 2);
        REQUIRE(at > before);
        before = at;
    }
    if (ticks < arrives * 110) return;  // the limit keeps it from arriving soon
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
    CHECK(clock.sync_state(pulse(2)) == versavis::wire::SyncState::followed);
    if (running) CHECK(std::abs(clock.board_time(clock.grid_time(pulse(2))) - before) < 4'000);
    for (int n = 3; n < 400; ++n) REQUIRE(follows(clock, pulse(n)));
    // There, at last: its pulses lie on whole seconds.
    const Nanoseconds whole = (clock.grid_time(pulse(400)) + second / 2) / second * second;
    CHECK(std::abs(clock.board_time(whole) - pulse(400)) < 10);
}

TEST_CASE("grid_clock: noise between the pulses of a sender is no other sender") {
    GridClock clock;
    clock.begin(5 * second, second);
    for (int n = 1; n < 100; ++n) {
        REQUIRE(follows(clock, (5 + n) * second));
        const Nanoseconds noise = (5 + n) * second + 100'000'000 + n * 7'000'000;
        REQUIRE(clock.sync_pulse(noise, true).what != GridClock::Sync::taken);
    }
}
