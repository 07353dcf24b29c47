// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/clock/translator.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "simulated_clocks.hpp"

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

namespace {

/// A translator on a machine that is simulated, with its board's clock equal to the host's.
struct SimulatedTranslator {
    SimulatedTranslator() {
        const std::int64_t now_ns = clocks->value_ns(SystemClock::monotonic_raw);
        translator.add({{now_ns - 10'000}, {now_ns}, {now_ns}, {now_ns + 10'000}});
    }
    BoardTime now() const { return {clocks->value_ns(SystemClock::monotonic_raw)}; }

    std::shared_ptr<test::SimulatedClocks> clocks = std::make_shared<test::SimulatedClocks>();
    Translator translator{*OutputClock::create(OutputClockKind::realtime, false, clocks)};
};

}  // namespace

TEST_CASE("translator: a stamp's epoch is that of the offset it was made with") {
    SimulatedTranslator machine;
    const auto before = machine.translator.translate(machine.now());
    machine.clocks->step(-seconds(1));
    const auto after = machine.translator.translate(machine.now());
    REQUIRE((before && after));
    CHECK(after->epoch == before->epoch + 1);
    CHECK(after->output < before->output);
    machine.clocks->suspend(seconds(60));
    CHECK(machine.translator.translate(HostTime{7}, {}).epoch == before->epoch + 2);
    CHECK(machine.translator.output_now().epoch == before->epoch + 2);
    const ClockReport report = machine.translator.report();
    CHECK(report.epoch == before->epoch + 2);
    CHECK(report.output_steps == 2);
    CHECK(report.host_suspends == 1);
}

TEST_CASE("translator: how well the output clock could be read is part of sigma") {
    SimulatedTranslator machine;
    const auto narrow = machine.translator.translate(HostTime{7}, microseconds(3));
    CHECK(narrow.sigma_ns == Approx(3'000).margin(5));
    for (int attempt = 0; attempt < 8; ++attempt) machine.clocks->preempt(4 * attempt + 2, milliseconds(2));
    const auto wide = machine.translator.translate(HostTime{7}, microseconds(3));
    CHECK(wide.sigma_ns == Approx(1'000'000 / std::sqrt(3.0)).margin(1'000));
    CHECK(absolute(wide.output - narrow.output) <= milliseconds(1));
}

TEST_CASE("translator: what the kernel says of its clock is reported as it is") {
    SimulatedTranslator machine;
    machine.clocks->kernel = {true, microseconds(17), 37};
    const ClockReport report = machine.translator.report();
    CHECK(report.kernel.synchronised);
    CHECK(report.kernel.max_error == microseconds(17));
    CHECK(report.kernel.tai_offset_s == 37);
    const OutputRelation relation = machine.translator.output_now();
    CHECK(relation.host.ns == Approx(machine.now().ns).margin(1'000));
    CHECK(relation.minus_host == report.output_minus_host);
    CHECK(relation.uncertainty > Duration{});
}
