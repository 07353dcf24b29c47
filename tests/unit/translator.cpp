// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/clock/translator.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::clock;

TEST_CASE("translator: nothing is translated before an exchange, and a board's new life is a new epoch") {
    Translator translator(*OutputClock::create(OutputClockKind::monotonic_raw));
    CHECK_FALSE(translator.translate(BoardTime{5}));
    translator.board_restarted();
    translator.add({{1'000'000}, {500}, {600}, {1'020'000}});
    const auto stamp = translator.translate(BoardTime{550});
    REQUIRE(stamp);
    CHECK(stamp->host == HostTime{1'010'000});
    CHECK(stamp->output.ns == stamp->host.ns);
    CHECK(stamp->sigma_ns > 0);
    CHECK(translator.report().exchanges == 1);
    const std::uint32_t epoch = stamp->epoch;
    translator.board_restarted();
    CHECK_FALSE(translator.translate(BoardTime{550}));
    CHECK(translator.translate(HostTime{7}, nanoseconds(1)).epoch == epoch + 1);
}
