// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/output_clock.hpp"

#include <catch2/catch.hpp>
#include <ctime>

#include "simulated_clocks.hpp"

using namespace versavis;
using namespace versavis::clock;
using test::SimulatedClocks;

namespace {

/// A machine and an output clock on it.
struct ClockMachine {
    explicit ClockMachine(OutputClockKind kind, bool force_tai = false)
        : output(make(kind, force_tai, clocks)), kind_(kind) {}

    static OutputClock make(OutputClockKind kind, bool force_tai,
                            const std::shared_ptr<SimulatedClocks>& clocks) {
        auto made = OutputClock::create(kind, force_tai, clocks);
        if (!made) throw std::runtime_error(made.error().message());
        return std::move(*made);
    }

    /// The true difference of the clocks at the host time of the reading, if it was read just now.
    Duration error(const OutputReading& reading) const {
        const SystemClock clock =
            kind_ == OutputClockKind::tai ? SystemClock::tai : SystemClock::realtime;
        const std::int64_t truth_ns =
            clocks->value_ns(clock) - clocks->value_ns(SystemClock::monotonic_raw);
        return {reading.minus_host.ns - truth_ns};
    }

    std::shared_ptr<SimulatedClocks> clocks = std::make_shared<SimulatedClocks>();
    OutputClock output;

 private:
    OutputClockKind kind_;
};

}  // namespace

TEST_CASE("output_clock: realtime is host time plus the offset") {
    auto clock = OutputClock::create(OutputClockKind::realtime);
    REQUIRE(clock);
    const Duration offset = clock->offset();
    timespec before{};
    timespec after{};
    clock_gettime(CLOCK_REALTIME, &before);
    const std::int64_t translated = host_now().ns + offset.ns;
    clock_gettime(CLOCK_REALTIME, &after);
    const auto ns = [](const timespec& t) {
        return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
    };
    CHECK(translated > ns(before) - 100'000);
    CHECK(translated < ns(after) + 100'000);
    CHECK(clock->steps() == 0);
}

TEST_CASE("output_clock: on the kernel's own clocks, a million readings show no step") {
    auto clock = OutputClock::create(OutputClockKind::realtime);
    REQUIRE(clock);
    for (int i = 0; i < 1'000'000; ++i) clock->read();
    CHECK(clock->steps() == 0);
    CHECK(clock->suspends() == 0);
}

TEST_CASE("output_clock: monotonic_raw is the host clock itself") {
    ClockMachine machine(OutputClockKind::monotonic_raw);
    CHECK(machine.output.offset().ns == 0);
    machine.clocks->step(seconds(1));
    machine.clocks->pass(seconds(1));
    CHECK(machine.output.read().steps == 0);
    machine.clocks->suspend(seconds(60));
    machine.clocks->pass(seconds(1));
    CHECK(machine.output.read().steps == 1);
    CHECK(machine.output.offset().ns == 0);
    CHECK(machine.output.suspends() == 1);
}

TEST_CASE("output_clock: a preempted reading is made again") {
    ClockMachine machine(OutputClockKind::realtime);
    const int nth = GENERATE(1, 2, 3, 4);
    machine.clocks->preempt(nth, milliseconds(2));
    const OutputReading reading = machine.output.read();
    CHECK(absolute(machine.error(reading)) <= reading.uncertainty);
    CHECK(reading.uncertainty < nanoseconds(100));
    CHECK(reading.steps == 0);
}

TEST_CASE(
    "output_clock: preempted at each try, the best of them is taken and shows how bad it is") {
    ClockMachine machine(OutputClockKind::realtime);
    // In the third try the least.
    for (int attempt = 0; attempt < 8; ++attempt)
        machine.clocks->preempt(4 * attempt + 2, attempt == 2 ? microseconds(50) : milliseconds(2));
    const OutputReading reading = machine.output.read();
    CHECK(absolute(machine.error(reading)) <= reading.uncertainty);
    CHECK(absolute(machine.error(reading)) > microseconds(20));
    CHECK(reading.uncertainty < microseconds(26));
    CHECK(machine.output.read().steps == 0);
}

TEST_CASE("output_clock: each step is seen by the next reading, and once") {
    ClockMachine machine(OutputClockKind::realtime);
    const auto by = GENERATE(seconds(1), -seconds(1), milliseconds(1), -milliseconds(1),
                             microseconds(50), -microseconds(50), microseconds(2));
    const bool notified = GENERATE(true, false);
    const Duration before = machine.output.offset();
    machine.clocks->step(by, notified);
    const OutputReading reading = machine.output.read();
    CHECK(reading.steps == 1);
    CHECK(absolute(reading.minus_host - before - by) < nanoseconds(200));
    for (int i = 0; i < 100; ++i) {
        if (i == 50 && !notified) machine.clocks->notify_of_set();  // the kernel comes late
        machine.clocks->pass(milliseconds(10));
        CHECK(machine.output.read().steps == 1);
    }
    machine.clocks->step(by, notified);
    CHECK(machine.output.read().steps == 2);
    CHECK(machine.output.suspends() == 0);
}

TEST_CASE("output_clock: a step too small for a comparison is reported by the kernel") {
    ClockMachine machine(OutputClockKind::realtime);
    machine.clocks->step(nanoseconds(400));
    machine.clocks->pass(milliseconds(101));
    CHECK(machine.output.read().steps == 1);
    machine.clocks->pass(seconds(1));
    CHECK(machine.output.read().steps == 1);
}

TEST_CASE("output_clock: a step is seen through a wide reading, too") {
    ClockMachine machine(OutputClockKind::realtime);
    const auto preempt_all = [&] {
        for (int attempt = 0; attempt < 8; ++attempt)
            machine.clocks->preempt(4 * attempt + 3,
                                    milliseconds(2));  // between the two that are compared
    };
    machine.clocks->step(microseconds(50));
    preempt_all();
    CHECK(machine.output.read().steps == 1);  // the kernel reported it
    machine.clocks->pass(milliseconds(10));
    CHECK(machine.output.read().steps == 1);
    machine.clocks->step(milliseconds(20), false);
    preempt_all();
    CHECK(machine.output.read().steps == 2);
    CHECK(machine.output.read().steps == 2);
    machine.clocks->step(microseconds(50), false);
    preempt_all();
    CHECK(machine.output.read().steps == 2);  // what nobody reported is not seen ...
    CHECK(machine.output.read().steps == 3);  // ... until a reading is narrow again
}

TEST_CASE("output_clock: slewing is no step") {
    ClockMachine machine(OutputClockKind::realtime);
    machine.clocks->slew_ppb = GENERATE(500'000, -500'000, 90'000'000, -90'000'000);
    for (int i = 0; i < 3000; ++i) {
        machine.clocks->pass(milliseconds(20));
        if (i % 10 == 0)
            for (int attempt = 0; attempt < 8; ++attempt)
                machine.clocks->preempt(4 * attempt + 1 + i / 10 % 4, milliseconds(2));
        CHECK(machine.output.read().steps == 0);
    }
}

TEST_CASE("output_clock: readings follow a slewed clock") {
    ClockMachine machine(OutputClockKind::realtime);
    machine.clocks->slew_ppb = 500'000;
    const Duration before = machine.output.offset();
    machine.clocks->pass(seconds(10));
    const OutputReading reading = machine.output.read();
    CHECK(absolute(reading.minus_host - before - milliseconds(5)) < microseconds(1));
    CHECK(absolute(machine.error(reading)) <= reading.uncertainty);
}

TEST_CASE("output_clock: the host clock stands still in a suspend: a step, and counted") {
    ClockMachine machine(GENERATE(OutputClockKind::realtime, OutputClockKind::tai), true);
    const Duration before = machine.output.offset();
    machine.clocks->suspend(seconds(60));
    const OutputReading reading = machine.output.read();
    CHECK(reading.steps == 1);
    CHECK(machine.output.suspends() == 1);
    CHECK(absolute(reading.minus_host - before - seconds(60)) < microseconds(1));
    machine.clocks->pass(seconds(1));
    CHECK(machine.output.read().steps == 1);
}

TEST_CASE("output_clock: a leap second is a step of UTC, and none of TAI") {
    const auto kind = GENERATE(OutputClockKind::realtime, OutputClockKind::tai);
    ClockMachine machine(kind, true);
    machine.clocks->insert_leap_second();
    for (int i = 0; i < 30; ++i) {
        machine.clocks->pass(milliseconds(50));
        const OutputReading reading = machine.output.read();
        CHECK(reading.steps == (kind == OutputClockKind::realtime ? 1 : 0));
        CHECK(absolute(machine.error(reading)) <= reading.uncertainty);
    }
}

TEST_CASE(
    "output_clock: TAI without an offset is refused, or forced and then stepped when it is set") {
    const auto clocks = std::make_shared<SimulatedClocks>();
    const auto refused = OutputClock::create(OutputClockKind::tai, false, clocks);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(),
               Catch::Contains("leapsectz") && Catch::Contains("force_tai"));
    clocks->kernel.tai_offset_s = 37;
    CHECK(OutputClock::create(OutputClockKind::tai, false, clocks));

    ClockMachine machine(OutputClockKind::tai, true);
    CHECK(machine.output.kernel_state().tai_offset_s == 0);
    CHECK(absolute(machine.error(machine.output.read())) < nanoseconds(100));
    machine.clocks->kernel.tai_offset_s = 37;
    const OutputReading reading = machine.output.read();
    CHECK(reading.steps == 1);
    CHECK(absolute(machine.error(reading)) < nanoseconds(100));
    CHECK(machine.output.kernel_state().tai_offset_s == 37);
}

TEST_CASE(
    "output_clock: a set that falls between a reading and the look is one step, with its offset") {
    ClockMachine machine(OutputClockKind::realtime);
    struct SetLater final : SystemClocks {
        explicit SetLater(SimulatedClocks& on) : inner(on) {}
        std::int64_t read_ns(SystemClock clock) override { return inner.read_ns(clock); }
        KernelState kernel_state() override { return inner.kernel_state(); }
        std::uint32_t times_set() override {
            if (armed) inner.step(seconds(3));
            armed = false;
            return inner.times_set();
        }
        SimulatedClocks& inner;
        bool armed = false;
    };
    const auto clocks = std::make_shared<SetLater>(*machine.clocks);
    OutputClock output = *OutputClock::create(OutputClockKind::realtime, false, clocks);
    machine.clocks->pass(milliseconds(200));
    clocks->armed = true;
    const OutputReading reading = output.read();
    CHECK_FALSE(clocks->armed);
    CHECK(reading.steps == 1);
    CHECK(absolute(machine.error(reading)) <= reading.uncertainty);
    machine.clocks->pass(seconds(1));
    CHECK(output.read().steps == 1);
}

TEST_CASE("output_clock: the dear look is rare") {
    ClockMachine machine(OutputClockKind::realtime);
    const int reads = machine.clocks->reads;
    const int looks = machine.clocks->looks;
    for (int i = 0; i < 1000; ++i) {
        machine.clocks->pass(milliseconds(1));
        machine.output.read();
    }
    CHECK(machine.clocks->looks - looks <= 10);
    CHECK(machine.clocks->reads - reads <= 4100);
}
