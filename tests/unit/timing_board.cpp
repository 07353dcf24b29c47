// SPDX-License-Identifier: BSD-3-Clause
#include "timing_board.hpp"

#include <catch2/catch.hpp>
#include <thread>

using namespace versavis;
using rig::LedScenario;
using rig::TimingBoard;

namespace {

using TimingRow = TimingBoard::Row;

constexpr HostTime at_us(std::int64_t us) { return HostTime{us * 1'000}; }

LedScenario present() {
    LedScenario scenario;
    scenario.present = true;
    return scenario;
}

}  // namespace

TEST_CASE("timing_board: one of four strides, and four count the strides") {
    TimingBoard board(present());
    CHECK(board.shown(0) == TimingRow{1, 1, 0, 0, 0, 0, 0, 0, 0, 1});
    CHECK(board.shown(3) == TimingRow{1, 0, 0, 0, 1, 0, 0, 0, 0, 1});
    CHECK(board.shown(4) == TimingRow{1, 1, 0, 0, 0, 1, 0, 0, 0, 1});
    CHECK(board.shown(4 * 11 + 2) == TimingRow{1, 0, 0, 1, 0, 1, 1, 0, 1, 1});
    CHECK(board.shown(64) == board.shown(0));
    LedScenario scenario = present();
    scenario.backward = scenario.high_bit_first = true;
    CHECK(TimingBoard(scenario).shown(4) == TimingRow{1, 0, 0, 0, 1, 0, 0, 0, 1, 1});
}

TEST_CASE("timing_board: brightness is the share of the exposure that an LED was on") {
    TimingBoard board(present());
    for (std::int64_t i = 1; i < 100; ++i) board.pulse(at_us(1000 * i));
    board.settle(at_us(99'000));
    CHECK(board.lit(at_us(100), at_us(900)) == board.shown(0));
    const TimingRow split = board.lit(at_us(1750), at_us(2750));
    CHECK(split.at(2) == Approx(0.25));
    CHECK(split.at(3) == Approx(0.75));
    const TimingRow turn = board.lit(at_us(3600), at_us(4600));  // a stride ends
    CHECK(turn.at(4) == Approx(0.4));
    CHECK(turn.at(1) == Approx(0.6));
    CHECK(turn.at(5) == Approx(0.6));
    const TimingRow longer = board.lit(at_us(4500), at_us(7000));
    CHECK(longer.at(1) == Approx(0.2));
    CHECK(longer.at(2) == Approx(0.4));
    CHECK(longer.at(3) == Approx(0.4));
}

TEST_CASE("timing_board: an exposure waits for its pulses", "[threads]") {
    TimingBoard board(present());
    std::thread teller([&] {
        board.pulse(at_us(1000));
        board.settle(at_us(1999));
        board.pulse(at_us(2000));
        board.settle(at_us(3000));
    });
    CHECK(board.lit(at_us(1500), at_us(2500)).at(3) == Approx(0.5));
    teller.join();
}

TEST_CASE("timing_board: what is long ago is forgotten, the count is not") {
    TimingBoard board(present());
    for (std::int64_t i = 1; i <= 50'000; ++i) board.pulse(at_us(100 * i));
    board.settle(at_us(5'000'000));
    CHECK(board.lit(at_us(4'999'910), at_us(4'999'990)) == board.shown(49'999));
}
