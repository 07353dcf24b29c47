// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/stream_witnesses.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <random>

using namespace versavis;
using namespace versavis::clock;

namespace {

constexpr std::size_t stream_count = 3;

/// A board whose clock is behind the host's and slower, its streams, and exchanges ten times a
/// second, over a link whose delays spread above a least one.
struct Link {
    Duration least_delay = microseconds(80);
    double spread_us = 30;
    /// By which stamps of the board are later than the truth, at a second of the test.
    std::function<Duration(double)> lie_of_exchanges = [](double) { return Duration{}; };
    std::function<Duration(double)> lie_of_stream = [](double) { return Duration{}; };  ///< the 0th
    std::function<Duration(double)> lie_of_others = [](double) { return Duration{}; };
    std::size_t talking = stream_count;  ///< streams that do
    std::size_t unfit = 0;               ///< of them, the first: theirs do not fit those before

    StreamWitnesses witnesses;
    std::mt19937_64 random{1};
    HostTime now{1'000'000'000'000};
    double elapsed_s = 0;

    Link() {
        for (const Witness witness : {Witness::grid, Witness::grid, Witness::own})
            witnesses.add_stream(witness);
    }

    static constexpr double skew_ns_per_s = 20'000;
    BoardTime board(HostTime at) const {
        const double s = static_cast<double>(at.ns) * 1e-9;
        return {at.ns - 5'000'000'000 - std::llround(skew_ns_per_s * s)};
    }
    Duration delay() {
        std::exponential_distribution<> spread(1 / spread_us);
        return least_delay + microseconds(1) * std::llround(spread(random));
    }
    void hear(std::size_t stream, HostTime at) {
        const Duration lie = (stream == 0 ? lie_of_stream : lie_of_others)(elapsed_s);
        const BoardTime said = board(at) + lie;
        // A larger message takes longer.
        const HostTime arrived =
            at + delay() + microseconds(10) * static_cast<std::int64_t>(stream);
        witnesses.heard(stream, {said, {arrived.ns - said.ns}}, stream >= unfit);
    }
    void exchange() {
        const Duration lie = lie_of_exchanges(elapsed_s);
        const HostTime received = now + delay();
        const HostTime answered = received + microseconds(50);
        witnesses.exchanged({now, board(received) + lie, board(answered) + lie, answered + delay()},
                            skew_ns_per_s);
    }
    void run(Duration length) {
        for (const HostTime end = now + length; now < end; now = now + milliseconds(5)) {
            elapsed_s += 0.005;
            for (std::size_t i = 0; i < talking; ++i) hear(i, now);
            if ((now.ns / 5'000'000) % 20 == 0) exchange();
        }
    }
    bool all_usual() const {
        for (std::size_t i = 0; i < stream_count; ++i)
            if (witnesses.departure(i)) return false;
        return true;
    }
};

}  // namespace

TEST_CASE("stream_witnesses: an honest link leaves neither exchanges nor streams in doubt") {
    Link link;
    link.spread_us = GENERATE(5.0, 30.0, 300.0);
    link.random.seed(GENERATE(1U, 2U, 3U));
    for (int i = 0; i < 600; ++i) {
        link.run(milliseconds(500));
        REQUIRE(link.all_usual());
        REQUIRE(link.witnesses.doubt() == Duration{});
    }
}

TEST_CASE("stream_witnesses: a stream that drifts departs alone, and returns") {
    Link link;
    link.run(seconds(10));
    const double begin = link.elapsed_s;
    const double us_per_s = GENERATE(-100.0, -10.0, -1.0, 1.0, 30.0, 100.0);
    const auto error = [&](double at) { return us_per_s * (at - begin); };
    link.lie_of_stream = [&](double at) { return microseconds(1) * std::llround(error(at)); };
    double steered = 0;
    while (!link.witnesses.departure(0) && std::abs(error(link.elapsed_s)) < 500) {
        link.run(milliseconds(5));
        if (link.witnesses.steers(0)) steered = error(link.elapsed_s);
    }
    CHECK(std::abs(error(link.elapsed_s)) < 160);
    CHECK(std::abs(steered) < 80);
    CHECK((link.witnesses.departure(0)->ns > 0) == (us_per_s > 0));
    for (int i = 0; i < 100; ++i) {
        link.run(milliseconds(50));
        REQUIRE(link.witnesses.departure(0));
        REQUIRE_FALSE(link.witnesses.steers(0));
        REQUIRE_FALSE(link.witnesses.departure(1));
        REQUIRE_FALSE(link.witnesses.departure(2));
    }
    CHECK(link.witnesses.doubt() == Duration{});
    link.lie_of_stream = [](double) { return Duration{}; };
    link.run(seconds(2));
    CHECK(link.all_usual());
}

TEST_CASE("stream_witnesses: exchanges that leave all streams are in doubt, and these are not") {
    Link link;
    link.run(seconds(10));
    const double begin = link.elapsed_s;
    const double us_per_s = GENERATE(-30.0, -1.0, 1.0, 30.0, 100.0);
    const auto error = [&](double at) { return us_per_s * (at - begin); };
    link.lie_of_exchanges = [&](double at) { return microseconds(1) * std::llround(error(at)); };
    while (link.witnesses.doubt() == Duration{} && std::abs(error(link.elapsed_s)) < 500)
        link.run(milliseconds(5));
    CHECK(std::abs(error(link.elapsed_s)) < 200);
    for (int i = 0; i < 100; ++i) {
        link.run(milliseconds(50));
        REQUIRE(link.all_usual());
        REQUIRE(link.witnesses.steers(0));  // it may be right
        REQUIRE(std::abs(static_cast<double>(link.witnesses.doubt().ns) * 1e-3 -
                         std::abs(error(link.elapsed_s))) < 200);
    }
    link.lie_of_exchanges = [](double) { return Duration{}; };
    link.run(seconds(3));
    CHECK(link.witnesses.doubt() == Duration{});
    CHECK(link.all_usual());
}

TEST_CASE("stream_witnesses: what lasts is believed in the end") {
    Link link;
    link.run(seconds(10));
    link.lie_of_exchanges = [](double) { return milliseconds(1); };
    link.run(seconds(5));
    CHECK(link.witnesses.doubt() > microseconds(900));
    link.run(seconds(100));
    CHECK(link.witnesses.doubt() > microseconds(900));
    link.run(seconds(30));
    CHECK(link.witnesses.doubt() == Duration{});
    CHECK(link.all_usual());
}

TEST_CASE("stream_witnesses: a minute of false times of one stream is not the new usual") {
    Link link;
    link.run(seconds(10));
    const Duration lie = GENERATE(milliseconds(1), -milliseconds(1));
    link.lie_of_stream = [lie](double) { return lie; };
    link.run(seconds(60));
    CHECK(link.witnesses.departure(0));
    link.run(seconds(20));
    CHECK(link.all_usual());
}

TEST_CASE("stream_witnesses: exchanges may be off by what no stream can deny yet") {
    Link link;
    link.run(milliseconds(100));
    CHECK(link.witnesses.allowance() == Duration{});  // nothing was heard
    link.run(seconds(3));
    CHECK(link.witnesses.allowance() == microseconds(50));
    link.run(seconds(7));
    CHECK(link.witnesses.allowance() == Duration{});
    link.lie_of_exchanges = [](double) { return microseconds(60); };
    link.run(seconds(2));
    CHECK(link.witnesses.doubt() == Duration{});
    CHECK(absolute(link.witnesses.allowance() - microseconds(60)) < microseconds(20));
}

TEST_CASE("stream_witnesses: a link that becomes quicker or slower changes nothing") {
    Link link;
    link.least_delay = milliseconds(1);
    link.run(seconds(10));
    link.least_delay = GENERATE(microseconds(80), microseconds(1200), milliseconds(3));
    for (int i = 0; i < 200; ++i) {
        link.run(milliseconds(50));
        REQUIRE(link.all_usual());
        REQUIRE(link.witnesses.doubt() == Duration{});
    }
}

TEST_CASE("stream_witnesses: one wrong answer puts nothing in doubt") {
    Link link;
    link.run(seconds(10));
    const Duration lie = milliseconds(GENERATE(-5, 5));
    const double begin = link.elapsed_s;
    link.lie_of_exchanges = [&](double at) { return at < begin + 0.1 ? lie : Duration{}; };
    for (int i = 0; i < 600; ++i) {
        link.run(milliseconds(5));
        REQUIRE(link.all_usual());
        REQUIRE(link.witnesses.doubt() == Duration{});
    }
}

TEST_CASE("stream_witnesses: one stream alone does not put exchanges in doubt") {
    Link link;
    link.run(seconds(10));
    link.talking = GENERATE(std::size_t{0}, std::size_t{1});
    link.run(seconds(2));
    link.lie_of_exchanges = [](double) { return milliseconds(1); };
    link.run(seconds(3));
    CHECK(link.witnesses.doubt() == Duration{});
    CHECK(link.witnesses.departure(0).has_value() == (link.talking == 1));
}

TEST_CASE("stream_witnesses: messages beside those that fit are confirmed by their delay") {
    Link link;
    link.run(seconds(10));
    CHECK(link.witnesses.confirms_others(0) == false);
    const Duration off = GENERATE(Duration{}, milliseconds(1));
    for (int i = 0; i < 200; ++i) {
        link.run(milliseconds(5));
        const BoardTime said = link.board(link.now) + off;
        const HostTime arrived = link.now + link.delay();
        link.witnesses.heard(0, {said, {arrived.ns - said.ns}}, false);
    }
    CHECK(link.witnesses.confirms_others(0) == (off == Duration{}));
}

TEST_CASE("stream_witnesses: a clock step is what no stream denies and the exchanges confirm") {
    Link link;
    link.least_delay = milliseconds(2);  // longer than the step
    link.spread_us = 100;
    link.run(seconds(20));
    CHECK_FALSE(link.witnesses.show_clock_step());
    const Duration step = GENERATE(-microseconds(900), microseconds(900));
    const auto stepped = [&](double) { return step; };
    link.unfit = stream_count;
    SECTION("the clock") {
        link.lie_of_stream = link.lie_of_others = link.lie_of_exchanges = stepped;
        int tenths = 0;
        for (; !link.witnesses.show_clock_step() && tenths < 50; ++tenths)
            link.run(milliseconds(100));
        CHECK(tenths <= (step.ns > 0 ? 4 : 18));  // until no answer of before is the quickest
        link.witnesses.clock_stepped();
        link.unfit = 0;
    }
    SECTION("the trigger grid alone") {
        link.talking = 2;
        link.run(seconds(5));
    }
    SECTION("one stream and the exchanges") {
        link.lie_of_stream = link.lie_of_exchanges = stepped;
        link.unfit = 1;
    }
    SECTION("all streams") { link.lie_of_stream = link.lie_of_others = stepped; }
    SECTION("all, but one stream denies it") {
        link.lie_of_stream = link.lie_of_others = link.lie_of_exchanges = stepped;
        link.unfit = stream_count - 1;
    }
    for (int i = 0; i < 100; ++i) {
        link.run(milliseconds(100));
        REQUIRE_FALSE(link.witnesses.show_clock_step());
    }
}
