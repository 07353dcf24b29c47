// SPDX-License-Identifier: BSD-3-Clause
#include "stream/event_witness.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("event_witness: pulses of PPS are a second apart, and no event comes from the future") {
    test::Pipelines bench;
    const HostTime begin{40'000'000'000};
    bench.synchronise(begin);
    EventWitness witness(bench.translator);
    const auto doubted = [&](wire::EventKind kind, std::int64_t pulse, Duration off) {
        const HostTime at = begin + seconds(pulse);
        wire::Event event{};
        event.kind = kind;
        event.value = pulse;
        event.time_ns = (test::Pipelines::to_board(at) + off).ns;
        return witness.judge(event, at + milliseconds(2)).has_value();
    };
    CHECK(doubted(wire::EventKind::pps, 0, {}));  // it is alone
    for (int i = 1; i < 20; ++i) CHECK_FALSE(doubted(wire::EventKind::pps, i, {}));
    CHECK(doubted(wire::EventKind::pps, 20, -milliseconds(300)));
    CHECK(doubted(wire::EventKind::pps, 21, -microseconds(200)));
    CHECK_FALSE(doubted(wire::EventKind::pps, 22, {}));
    CHECK(doubted(wire::EventKind::aux_pulse, 23, seconds(1000)));
    CHECK_FALSE(doubted(wire::EventKind::aux_pulse, 23, {}));
}
