// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/translator.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "simulated_clocks.hpp"

using namespace versavis;
using namespace versavis::clock;

TEST_CASE(
    "translator: nothing is translated before two exchanges, and a board's new life is a new "
    "epoch") {
    Translator translator(*OutputClock::create(OutputClockKind::monotonic_raw));
    CHECK_FALSE(translator.translate(BoardTime{5}));
    translator.board_restarted();
    translator.add({{1'000'000}, {500}, {600}, {1'020'000}});
    CHECK_FALSE(translator.translate(BoardTime{550}));
    translator.add({{1'000'000}, {500}, {600}, {1'020'000}});
    const auto stamp = translator.translate(BoardTime{550});
    REQUIRE(stamp);
    CHECK(absolute(stamp->host - HostTime{1'010'000}) < microseconds(1));
    CHECK(stamp->output.ns == stamp->host.ns);
    CHECK(stamp->sigma_ns > 0);
    CHECK(translator.report().exchanges == 2);
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
        for (int i = 0; i < 2; ++i)
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
    for (int attempt = 0; attempt < 8; ++attempt)
        machine.clocks->preempt(4 * attempt + 2, milliseconds(2));
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

namespace {

/// A board whose link is longer to the host by twice `asymmetry`, with PPS; its clock equals the
/// host's.
struct PpsMachine {
    explicit PpsMachine(PpsLabels labels, SecondConflict on_conflict = SecondConflict::flag)
        : translator(*OutputClock::create(OutputClockKind::realtime, false, clocks), labels, 0,
                     on_conflict) {
        clocks->kernel.synchronised = true;
    }

    /// A second with ten exchanges and, in its middle, the pulse of the output clock's second.
    void pass_second(bool pulse) {
        for (int i = 0; i < 10; ++i) {
            const HostTime now{clocks->value_ns(SystemClock::monotonic_raw)};
            const Duration up = microseconds(20) + asymmetry * 2;
            translator.add({now - microseconds(20), {now.ns}, {now.ns}, now + up});
            clocks->pass(milliseconds(100));
        }
        const std::int64_t utc_ns = clocks->value_ns(SystemClock::realtime);
        const std::int64_t past = utc_ns % 1'000'000'000;
        const BoardTime at{clocks->value_ns(SystemClock::monotonic_raw) - past};
        if (!pulse) return;
        translator.pps_pulse(at);
        translator.pps_label(at, utc_ns - past);
    }
    Duration error() {
        const BoardTime now{clocks->value_ns(SystemClock::monotonic_raw)};
        return translator.translate(now)->output -
               OutputTime{clocks->value_ns(SystemClock::realtime)};
    }

    static constexpr Duration asymmetry = microseconds(40);
    std::shared_ptr<test::SimulatedClocks> clocks = std::make_shared<test::SimulatedClocks>();
    Translator translator;
};

}  // namespace

TEST_CASE("translator: PPS makes the stamps, and what it measured is taken off when it is gone") {
    PpsMachine machine(PpsLabels::host);
    for (int i = 0; i < 20; ++i) machine.pass_second(false);
    CHECK(absolute(machine.error() - PpsMachine::asymmetry) < microseconds(5));
    CHECK(machine.translator.report().pps.state == PpsState::waiting);
    for (int i = 0; i < 40; ++i) machine.pass_second(true);
    ClockReport report = machine.translator.report();
    CHECK(report.pps.state == PpsState::used);
    CHECK(absolute(machine.error()) < microseconds(1));
    CHECK(report.asymmetry_source == AsymmetrySource::pps);
    CHECK(absolute(report.asymmetry.offset - PpsMachine::asymmetry) < microseconds(3));
    const std::uint32_t epoch = report.epoch;
    for (int i = 0; i < 10; ++i) machine.pass_second(false);
    report = machine.translator.report();
    CHECK(report.pps.state == PpsState::lost);
    CHECK(absolute(machine.error()) < microseconds(5));
    CHECK(report.epoch == epoch);
}

TEST_CASE("translator: a host that nobody disciplines names no seconds") {
    PpsMachine machine(PpsLabels::host);
    machine.clocks->kernel.synchronised = false;
    for (int i = 0; i < 40; ++i) machine.pass_second(true);
    CHECK(machine.translator.report().pps.state == PpsState::waiting);
    CHECK(machine.translator.report().asymmetry_source == AsymmetrySource::none);
}

TEST_CASE(
    "translator: seconds by a receiver hold whatever the host's clock shows, in an epoch of their "
    "own") {
    PpsMachine machine(PpsLabels::nmea);
    for (int i = 0; i < 20; ++i) machine.pass_second(false);
    const std::uint32_t epoch = machine.translator.translate(BoardTime{})->epoch;
    for (int i = 0; i < 5; ++i) {
        machine.pass_second(false);
        const std::int64_t utc_ns = machine.clocks->value_ns(SystemClock::realtime);
        const std::int64_t past = utc_ns % 1'000'000'000;
        // The host is 7 s behind.
        machine.translator.pps_label({machine.clocks->value_ns(SystemClock::monotonic_raw) - past},
                                     utc_ns - past + 7'000'000'000);
    }
    CHECK(absolute(machine.error() - seconds(7)) < microseconds(1));
    const BoardTime now{machine.clocks->value_ns(SystemClock::monotonic_raw)};
    CHECK(machine.translator.translate(now)->epoch == epoch + 1);
    // Host time is the link's: pairing waits for frames by it.
    CHECK(absolute(machine.translator.translate(now)->host - HostTime{now.ns}) < microseconds(50));
    CHECK(machine.translator.report().pps.residual < -seconds(6));
}

namespace {

/// A receiver that is `ahead` of the host, heard for so many seconds; what each label changed.
std::vector<std::optional<std::int64_t>> hear(PpsMachine& machine, Duration ahead, int times) {
    std::vector<std::optional<std::int64_t>> changes;
    for (int i = 0; i < times; ++i) {
        machine.pass_second(false);
        const std::int64_t utc_ns = machine.clocks->value_ns(SystemClock::realtime) + ahead.ns;
        const std::int64_t past = utc_ns % 1'000'000'000;
        changes.push_back(machine.translator.pps_label(
            {machine.clocks->value_ns(SystemClock::monotonic_raw) - past}, utc_ns - past));
    }
    return changes;
}

bool second_doubted(PpsMachine& machine) {
    const BoardTime now{machine.clocks->value_ns(SystemClock::monotonic_raw)};
    const bool doubted = machine.translator.translate(now)->second_doubted;
    CHECK(machine.translator.translate(HostTime{now.ns}, {}).second_doubted == doubted);
    return doubted;
}

using Changes = std::vector<std::optional<std::int64_t>>;

}  // namespace

TEST_CASE(
    "translator: a receiver that is off from the host by whole seconds is named, and marked") {
    const int off = GENERATE(-1, 1, 2, 18, -37, 3600);
    const SecondConflict on_conflict =
        GENERATE(SecondConflict::flag, SecondConflict::receiver, SecondConflict::host);
    PpsMachine machine(PpsLabels::nmea, on_conflict);
    for (int i = 0; i < 20; ++i) machine.pass_second(false);
    CHECK(hear(machine, {}, 6) == Changes(6));
    CHECK_FALSE(second_doubted(machine));
    CHECK(hear(machine, seconds(off), 2) == Changes(2));  // it may be a label that came late
    CHECK(hear(machine, {}, 1) == Changes(1));
    CHECK(hear(machine, seconds(off), 8) == Changes{{}, {}, off, {}, {}, {}, {}, {}});
    CHECK(machine.translator.report().pps.second_difference == off);
    CHECK(second_doubted(machine) == (on_conflict == SecondConflict::flag));
    const Duration used = seconds(on_conflict == SecondConflict::host ? 0 : off);
    CHECK(absolute(machine.error() - used) < microseconds(50));
    CHECK(hear(machine, {}, 4) == Changes{{}, {}, 0, {}});
    CHECK_FALSE(second_doubted(machine));
    hear(machine, seconds(off), 4);
    machine.translator.board_restarted();
    CHECK(machine.translator.report().pps.second_difference == 0);
}

TEST_CASE("translator: a host that nobody disciplines denies only what is no accident") {
    for (const auto& [ahead, difference] :
         {std::pair{seconds(7), 7}, std::pair{seconds(40), 40}, std::pair{seconds(41), 0},
          std::pair{seconds(7) + milliseconds(9), 7}, std::pair{seconds(7) - milliseconds(9), 7},
          std::pair{seconds(7) + milliseconds(11), 0}, std::pair{milliseconds(7300), 0}}) {
        PpsMachine machine(PpsLabels::nmea, GENERATE(SecondConflict::flag, SecondConflict::host));
        machine.clocks->kernel.synchronised = false;
        for (int i = 0; i < 20; ++i) machine.pass_second(false);
        hear(machine, ahead, 6);
        CHECK(machine.translator.report().pps.second_difference == difference);
        CHECK(absolute(machine.error() - ahead) < microseconds(50));  // the receiver's in any case
    }
}

TEST_CASE("translator: a stored asymmetry is used until PPS measures another") {
    PpsMachine machine(PpsLabels::host);
    machine.translator.use_asymmetry(Asymmetry{PpsMachine::asymmetry, microseconds(5)});
    for (int i = 0; i < 20; ++i) machine.pass_second(false);
    CHECK(absolute(machine.error()) < microseconds(5));
    CHECK(machine.translator.report().asymmetry_source == AsymmetrySource::stored);
    for (int i = 0; i < 40; ++i) machine.pass_second(true);
    CHECK(machine.translator.report().asymmetry_source == AsymmetrySource::pps);
    machine.translator.use_asymmetry(std::nullopt);
    CHECK(machine.translator.report().asymmetry_source == AsymmetrySource::none);
}

namespace {

/// A board whose clock is 5 s behind the host's, with exchanges ten times a second and two streams
/// of 200 Hz that steer the clock where they may.
struct Board {
    Translator translator{*OutputClock::create(OutputClockKind::monotonic_raw)};
    std::size_t streams[2]{translator.add_stream(Witness::grid),
                           translator.add_stream(Witness::own)};
    std::mt19937_64 random{1};
    HostTime now{1'000'000'000'000};
    Duration offset = -seconds(5);
    double spread_us = 500;  ///< of delays
    Duration lie;            ///< by which exchanges are later than the truth
    bool fits = true;        ///< messages follow those of their stream before them

    BoardTime board(HostTime at) const { return {(at + offset).ns}; }
    Duration delay() {
        std::exponential_distribution<> spread(1e-3 / spread_us);
        return microseconds(80) + Duration{std::llround(spread(random))};
    }
    void hear(std::size_t stream) {
        const OneWay message{board(now), now + delay()};
        translator.heard(stream, message, fits);
        if (!fits) return;
        if (const auto estimate = translator.to_host(message.sent))
            if (message.arrived - estimate->time < microseconds(200)) translator.clock_continues();
        if (translator.steers(stream)) translator.add(message);
    }
    void exchange() {
        for (int i = 0; i < 20; ++i) {
            now = now + milliseconds(5);
            for (const std::size_t stream : streams) hear(stream);
        }
        const HostTime received = now + delay();
        translator.add({now, board(received) + lie, board(received) + lie, received + delay()});
    }
    void exchange(int times) {
        for (int i = 0; i < times; ++i) exchange();
    }
};

}  // namespace

TEST_CASE("translator: exchanges that the streams deny begin no estimate") {
    Board it;
    it.exchange(100);
    const int exchanges_before = GENERATE(0, 1, 2, 5, 100);
    if (exchanges_before < 100) it.translator.board_restarted();
    it.exchange(exchanges_before);
    it.lie = GENERATE(milliseconds(15), -milliseconds(15), seconds(3));
    const std::uint32_t epoch = it.translator.report().epoch;
    for (int i = 0; i < 40; ++i) {
        it.exchange();
        if (const auto stamp = it.translator.translate(it.board(it.now)))
            CHECK(absolute(stamp->host - it.now).ns <= 4 * std::int64_t{stamp->sigma_ns});
    }
    it.lie = {};
    it.exchange(100);
    CHECK(it.translator.translate(it.board(it.now))->state == ClockState::locked);
    CHECK(it.translator.report().epoch == epoch);
}

TEST_CASE("translator: exchanges that lie for long make no stamp wrong, and no epoch") {
    Board it;
    it.spread_us = 30;
    it.random.seed(GENERATE(1U, 2U, 3U));
    it.exchange(GENERATE(200, 600));
    struct Lie {
        std::int64_t us;
        std::int64_t us_per_s;
        int exchanges;
    };
    const Lie lie =
        GENERATE(Lie{200, 0, 50}, Lie{-200, 0, 600}, Lie{1000, 0, 600}, Lie{-5000, 0, 2},
                 Lie{0, 300, 100}, Lie{0, -100, 100}, Lie{0, 30, 120}, Lie{0, -10, 250});
    CAPTURE(lie.us, lie.us_per_s);
    const std::uint32_t epoch = it.translator.report().epoch;
    for (int i = 0; i < lie.exchanges + 100; ++i) {
        it.lie = i < lie.exchanges ? microseconds(lie.us + lie.us_per_s * i / 10) : Duration{};
        it.exchange();
        const auto stamp = it.translator.translate(it.board(it.now));
        REQUIRE(absolute(stamp->host - it.now).ns <=
                std::max<std::int64_t>(100'000, 4 * std::int64_t{stamp->sigma_ns}));
    }
    CHECK(it.translator.translate(it.board(it.now))->state == ClockState::locked);
    CHECK(it.translator.translate(it.board(it.now))->sigma_ns < 100'000);
    CHECK(it.translator.report().epoch == epoch);
}

TEST_CASE("translator: a step of the board's clock is followed with the third exchange") {
    Board it;
    it.exchange(100);
    const std::uint32_t epoch = it.translator.report().epoch;
    it.offset = it.offset + GENERATE(milliseconds(15), -milliseconds(15), seconds(3));
    it.fits = false;  // until they are adopted
    it.exchange(3);
    CHECK(it.translator.report().epoch == epoch + 1);
    it.fits = true;
    it.exchange(30);
    CHECK(it.translator.report().epoch == epoch + 1);
    CHECK(it.translator.translate(it.board(it.now))->state == ClockState::locked);
}
