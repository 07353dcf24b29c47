// SPDX-License-Identifier: BSD-3-Clause
#include "board/time_announcer.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

#include "simulated_clocks.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr double board_fast_ppm = 30;

/// A host whose clocks and board are those of the test; tens of exchanges a second.
struct TimeBench {
    explicit TimeBench(clock::OutputClockKind kind = clock::OutputClockKind::realtime,
                       const std::vector<TimeOutputConfiguration>& outputs = {{}})
        : translator(*clock::OutputClock::create(kind, true, clocks)), announcer(outputs) {}

    HostTime now() const { return {clocks->value_ns(clock::SystemClock::monotonic_raw)}; }
    BoardTime board(HostTime at) const {
        return BoardTime{std::llround(static_cast<double>(at.ns) * (1 + board_fast_ppm * 1e-6))};
    }
    /// Runs for so long; returns the newest messages.
    std::vector<wire::TimeOutput> run(Duration duration) {
        std::vector<wire::TimeOutput> newest;
        for (const HostTime end = now() + duration; now() < end;) {
            clocks->pass(milliseconds(50));
            const HostTime at = now();
            if (linked)
                translator.add({at, board(at + microseconds(100)), board(at + microseconds(100)),
                                at + microseconds(200)});
            auto messages = announcer.messages(at, translator);
            if (!messages.empty()) newest = std::move(messages);
        }
        return newest;
    }
    bool known(Duration duration) {
        const auto messages = run(duration);
        return !messages.empty() && (messages[0].flags & wire::time_known) != 0;
    }
    std::string hint() const { return announcer.report(now())[0].hint; }
    /// UTC in ns at board time.
    std::int64_t utc_at(BoardTime at) const {
        const double since =
            static_cast<double>(at.ns - board(now()).ns) / (1 + board_fast_ppm * 1e-6);
        return clocks->value_ns(clock::SystemClock::realtime) + std::llround(since);
    }

    std::shared_ptr<test::SimulatedClocks> clocks = std::make_shared<test::SimulatedClocks>();
    clock::Translator translator;
    TimeAnnouncer announcer;
    bool linked = true;
};

/// To so long before the end of the UTC day.
Duration before_midnight(const TimeBench& bench, Duration left) {
    constexpr std::int64_t day_ns = 86'400'000'000'000;
    const std::int64_t utc = bench.clocks->value_ns(clock::SystemClock::realtime);
    return Duration{day_ns - utc % day_ns} - left;
}

}  // namespace

TEST_CASE("time_announcer: the board learns where the next second of UTC lies") {
    TimeOutputConfiguration output;
    output.model = &time_output_models()[1];
    output.output = wire::test_at_sync;
    output.delay_us = -2.5;
    output.sentences = {"ZDA", "RMC"};
    TimeBench bench(clock::OutputClockKind::realtime, {output});
    bench.run(seconds(20));
    const auto messages = bench.run(seconds(2));
    REQUIRE(messages.size() == 1);
    const wire::TimeOutput& message = messages[0];
    CHECK((message.flags & wire::time_known) != 0);
    CHECK((message.flags & wire::time_serial_inverted) != 0);
    CHECK(message.output == wire::test_at_sync);
    CHECK(message.delay_ns == -2'500);
    CHECK(message.pulse_ns == 30'000'000);
    CHECK(message.sentences == (wire::sentence_rmc | wire::sentence_zda));
    CHECK(message.holdover_s == 30);
    CHECK(message.pace_ppb == Approx(30'000).margin(300));
    CHECK(std::llabs(bench.utc_at(BoardTime{message.board_ns}) - message.utc_s * 1'000'000'000) <
          5'000);
    const std::int64_t utc_ns = bench.clocks->value_ns(clock::SystemClock::realtime);
    CHECK(std::llabs(message.utc_s - utc_ns / 1'000'000'000) <= 1);
}

TEST_CASE("time_announcer: what an earlier service used ends, once for each connection") {
    const auto unused = [](const wire::TimeOutput& message) { return message.pulse_ns == 0; };
    TimeBench none(clock::OutputClockKind::realtime, {});
    for (int i = 0; i < 2; ++i) {
        const auto messages = none.announcer.messages(none.now(), none.translator);
        REQUIRE(messages.size() == 2);
        CHECK(std::all_of(messages.begin(), messages.end(), unused));
        CHECK(messages[0].index + messages[1].index == 1);
        CHECK(none.announcer.messages(none.now() + seconds(2), none.translator).empty());
        none.announcer.begin();
    }
    TimeBench one;
    const auto messages = one.announcer.messages(one.now(), one.translator);
    REQUIRE(messages.size() == 2);
    CHECK((unused(messages[0]) && messages[0].index == 1));
    CHECK_FALSE(unused(messages[1]));
}

TEST_CASE("time_announcer: with TAI as output clock the second is UTC's all the same") {
    TimeBench bench(clock::OutputClockKind::tai);
    bench.clocks->kernel.tai_offset_s = 37;
    bench.run(seconds(20));
    const auto messages = bench.run(seconds(2));
    REQUIRE(messages.size() == 1);
    CHECK(std::llabs(bench.utc_at(BoardTime{messages[0].board_ns}) -
                     messages[0].utc_s * 1'000'000'000) < 5'000);
}

TEST_CASE("time_announcer: no second is named that may be wrong") {
    TimeBench bench;
    CHECK_FALSE(bench.known(seconds(2)));
    CHECK(bench.known(seconds(20)));
    SECTION("after a step of the host's clock, at once and for a while") {
        bench.clocks->step(seconds(1));
        CHECK_FALSE(bench.known(milliseconds(200)));
        CHECK(bench.hint() == "the output clock was just set, or the board has just connected");
        CHECK_FALSE(bench.known(seconds(2)));
        CHECK(bench.known(seconds(3)));
    }
    SECTION("without the board") {
        bench.linked = false;
        CHECK_FALSE(bench.known(seconds(30)));
        CHECK(bench.hint().find("the estimate of the board's clock is not locked") == 0);
    }
    SECTION("a new connection") {
        bench.announcer.begin();
        CHECK_FALSE(bench.known(seconds(2)));
        CHECK(bench.known(seconds(3)));
    }
    SECTION("a host that does not know the year") {
        bench.clocks->step(-seconds(800'000'000));
        CHECK_FALSE(bench.known(seconds(10)));
        CHECK(bench.hint() == "the host's clock is not between the years 2000 and 2099: set it");
    }
}

TEST_CASE("time_announcer: firmware without time outputs is named as the cause") {
    TimeBench bench;
    bench.announcer.board_lacks_them();
    CHECK(bench.hint() ==
          "the board's firmware has no time outputs: update it with 'versavis flash'");
}

TEST_CASE("time_announcer: around a leap second nothing is named, and no holdover reaches it") {
    TimeBench bench;
    bench.run(seconds(20));
    bench.clocks->step(before_midnight(bench, seconds(30)));
    bench.clocks->kernel.leap_s = 1;
    bench.run(seconds(8));
    const auto messages = bench.run(seconds(2));
    REQUIRE(messages.size() == 1);
    CHECK((messages[0].flags & wire::time_known) != 0);
    CHECK(messages[0].holdover_s < 20);
    CHECK(messages[0].utc_s % 86'400 + messages[0].holdover_s <= 86'397);
    CHECK_FALSE(bench.known(seconds(18)));
    CHECK(bench.hint() == "a leap second is near");
    CHECK_FALSE(bench.known(seconds(3)));
    bench.clocks->insert_leap_second();
    bench.clocks->kernel.leap_s = 0;
    CHECK_FALSE(bench.known(seconds(2)));
    CHECK(bench.known(seconds(5)));
}

TEST_CASE("time_announcer: pulses that the board reports are compared with the output clock") {
    TimeBench bench;
    bench.run(seconds(20));
    const auto messages = bench.run(seconds(2));
    REQUIRE(messages.size() == 1);
    bench.run(seconds(1));
    wire::Event event{};
    event.kind = wire::BoardEventKind::time_pulse;
    event.time_ns = messages[0].board_ns;
    event.value = messages[0].utc_s;
    CHECK_FALSE(bench.announcer.sent(event, bench.now(), bench.translator));
    TimeOutputReport report = bench.announcer.report(bench.now())[0];
    CHECK(report.state == TimeOutputState::sending);
    CHECK(report.pulses == 1);
    CHECK(report.utc_s == event.value);
    REQUIRE(report.error);
    CHECK(absolute(*report.error) < microseconds(5));
    SECTION("none for long") {
        bench.run(seconds(4));
        report = bench.announcer.report(bench.now())[0];
        CHECK(report.state == TimeOutputState::silent);
    }
    SECTION("the pulse of another second") {
        event.value += 1;
        const auto error = bench.announcer.sent(event, bench.now(), bench.translator);
        REQUIRE(error);
        CHECK(error->ns == Approx(-1e9).margin(1e5));
        CHECK_FALSE(bench.known(milliseconds(500)));
        report = bench.announcer.report(bench.now())[0];
        CHECK(report.state == TimeOutputState::wrong);
        CHECK(report.hint.find("a pulse was -10000") == 0);
        CHECK(bench.known(seconds(5)));
    }
    SECTION("one of an output that an earlier service used") {
        event.source = 1;
        CHECK_FALSE(bench.announcer.sent(event, bench.now(), bench.translator));
    }
}
