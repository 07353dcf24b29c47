// SPDX-License-Identifier: BSD-3-Clause
#include "board/grid_alignment.hpp"

#include <catch2/catch.hpp>
#include <cmath>

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr double skew_ppm = 40;  // of the host against the board
constexpr Duration board_behind = seconds(3);

HostTime host_of(BoardTime board) {
    return HostTime{board.ns + std::llround(static_cast<double>(board.ns) * skew_ppm * 1e-6)} +
           board_behind;
}

/// A clock that was compared ten times a second until `end`, each way taking `way`.
void compare(clock::Translator& translator, BoardTime begin, BoardTime end, Duration way) {
    for (BoardTime at = begin; at < end; at = at + milliseconds(100))
        translator.add({host_of(at) - way, at, at, host_of(at) + way});
}

struct AlignmentBench {
    explicit AlignmentBench(bool align = true) : alignment(settings(align), board()) {}

    static ClockConfiguration settings(bool align) {
        ClockConfiguration clock;
        clock.align = align;
        clock.max_slew_ppm = 20;
        return clock;
    }
    static wire::Configuration board() {
        wire::Configuration configuration{};
        configuration.cameras[2].rate_uhz = 29'970'000;
        configuration.cameras[2].phase_ns = 5'000'000;
        return configuration;
    }

    clock::Translator translator{
        *clock::OutputClock::create(clock::OutputClockKind::monotonic_raw)};
    GridAlignment alignment;
};

wire::Exposure aligned_exposure(std::uint64_t tick, std::uint16_t flags = wire::exposure_measured) {
    wire::Exposure record{};
    record.camera = 2;
    record.tick = tick;
    record.flags = flags;
    return record;
}

}  // namespace

TEST_CASE("grid_alignment: the board learns where the next whole second of the output clock lies") {
    AlignmentBench bench;
    compare(bench.translator, BoardTime{}, BoardTime{60'000'000'000}, microseconds(100));
    const HostTime now = host_of(BoardTime{60'000'000'000});
    const auto message = bench.alignment.message(now, bench.translator);
    REQUIRE(message);
    const HostTime second = host_of(BoardTime{message->board_ns});
    CHECK(second > now);
    CHECK(second <= now + seconds(1));
    CHECK(std::abs(std::remainder(static_cast<double>(second.ns), 1e9)) < 2'000);
    CHECK(message->pace_ppb == Approx(-40'000).margin(300));
    CHECK(message->max_slew_ppb == 20'000);
    // Once a second, and at once when the connection is new.
    CHECK_FALSE(bench.alignment.message(now + milliseconds(999), bench.translator));
    CHECK(bench.alignment.message(now + milliseconds(1001), bench.translator));
    bench.alignment.begin();
    CHECK(bench.alignment.message(now + milliseconds(1002), bench.translator));
}

TEST_CASE("grid_alignment: nothing is said that is not wanted, or not known well enough") {
    const HostTime now = host_of(BoardTime{10'000'000'000});
    SECTION("not wanted") {
        AlignmentBench bench(false);
        compare(bench.translator, BoardTime{}, BoardTime{10'000'000'000}, microseconds(100));
        CHECK_FALSE(bench.alignment.message(now, bench.translator));
    }
    SECTION("no exchange yet") {
        AlignmentBench bench;
        CHECK_FALSE(bench.alignment.message(now, bench.translator));
    }
    SECTION("a link that is too slow to know the time by") {
        AlignmentBench bench;
        compare(bench.translator, BoardTime{}, BoardTime{10'000'000'000}, milliseconds(40));
        CHECK_FALSE(bench.alignment.message(now, bench.translator));
    }
    SECTION("no contact for long") {
        AlignmentBench bench;
        compare(bench.translator, BoardTime{}, BoardTime{10'000'000'000}, microseconds(100));
        CHECK_FALSE(bench.alignment.message(now + seconds(5), bench.translator));
        CHECK(bench.alignment.message(now, bench.translator));
    }
}

TEST_CASE("grid_alignment: where the grid truly lies is seen by the middles of exposures") {
    AlignmentBench bench;
    compare(bench.translator, BoardTime{}, BoardTime{10'000'000'000}, microseconds(100));
    const HostTime now = host_of(BoardTime{10'000'000'000});
    CHECK_FALSE(bench.alignment.report(now).aligned);
    REQUIRE(bench.alignment.message(now, bench.translator));
    CHECK(bench.alignment.report(now).aligned);
    const auto see = [&](Duration error) {
        for (const std::uint64_t tick :
             {1'000'000U, 1'000'001U, 1'000'002U, 1'000'003U, 1'000'004U}) {
            const auto since = static_cast<std::int64_t>(static_cast<double>(tick) / 29.97 * 1e9);
            const Duration odd = tick == 1'000'002 ? milliseconds(20)
                                                   : Duration{};  // an exposure that nobody foresaw
            bench.alignment.exposure(aligned_exposure(tick),
                                     OutputTime{77'005'000'000 + since} + error + odd, now);
        }
        bench.alignment.exposure(aligned_exposure(5, wire::exposure_no_end), OutputTime{1}, now);
    };
    see(microseconds(-7));
    CHECK(bench.alignment.report(now).error.ns == Approx(-7'000).margin(50));
    CHECK(bench.alignment.report(now).aligned);
    see(milliseconds(300));
    see(milliseconds(300));
    CHECK(bench.alignment.report(now).error.ns == Approx(300'000'000).margin(50));
    CHECK_FALSE(bench.alignment.report(now).aligned);
    // What was seen and said long ago says nothing of now.
    CHECK(bench.alignment.report(now + seconds(4)).error.ns == 0);
    CHECK_FALSE(bench.alignment.report(now + seconds(4)).aligned);
}
