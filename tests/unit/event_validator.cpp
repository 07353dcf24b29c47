// SPDX-License-Identifier: BSD-3-Clause
#include "plausibility/event_validator.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("event_validator: pulses of PPS are a second apart, and no event comes from the future") {
    test::Pipelines bench;
    const HostTime begin{40'000'000'000};
    bench.synchronise(begin);
    EventValidator validator(bench.translator);
    const auto doubted = [&](wire::BoardEventKind kind, std::int64_t pulse, Duration off) {
        const HostTime at = begin + seconds(pulse);
        wire::Event event{};
        event.kind = kind;
        event.value = pulse;
        event.time_ns = (test::Pipelines::to_board(at) + off).ns;
        return validator.judge(event, at + milliseconds(2)).has_value();
    };
    CHECK(doubted(wire::BoardEventKind::pps, 0, {}));  // it is alone
    for (int i = 1; i < 20; ++i) CHECK_FALSE(doubted(wire::BoardEventKind::pps, i, {}));
    CHECK(doubted(wire::BoardEventKind::pps, 20, -milliseconds(300)));
    CHECK(doubted(wire::BoardEventKind::pps, 21, -microseconds(200)));
    CHECK_FALSE(doubted(wire::BoardEventKind::pps, 22, {}));
    CHECK(doubted(wire::BoardEventKind::aux_pulse, 23, seconds(1000)));
    CHECK_FALSE(doubted(wire::BoardEventKind::aux_pulse, 23, {}));
}

TEST_CASE(
    "event_validator: of whatever kind, an event from the future or the far past is doubted") {
    test::Pipelines bench;
    const HostTime begin{40'000'000'000};
    bench.synchronise(begin);
    EventValidator validator(bench.translator);
    const HostTime now = begin + seconds(20);
    constexpr int kinds_on_the_wire = 17;
    for (int kind = 1; kind <= kinds_on_the_wire; ++kind) {
        if (static_cast<wire::BoardEventKind>(kind) == wire::BoardEventKind::pps) continue;
        INFO("kind " << kind);
        wire::Event event{};
        event.kind = static_cast<wire::BoardEventKind>(kind);
        const auto judge = [&](Duration age) {
            event.time_ns = test::Pipelines::to_board(now - age).ns;
            return validator.judge(event, now);
        };
        CHECK_FALSE(judge(milliseconds(2)));
        CHECK_FALSE(judge(seconds(9)));
        CHECK(judge(-milliseconds(20))->reason == EventReason::not_yet);
        CHECK(judge(seconds(11))->reason == EventReason::too_old);
    }
}
