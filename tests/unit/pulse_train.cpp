// SPDX-License-Identifier: BSD-3-Clause
#include "pulse_train.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "nanoseconds.hpp"

using namespace versavis::firmware;
using namespace versavis::test;

namespace {

/// Notes when its output rises and falls.
struct TrainHardware final : OutputSchedule {
    std::vector<Nanoseconds> changes;
    Nanoseconds push(Nanoseconds at, std::uint32_t levels) override {
        CHECK(levels == (changes.size() % 2 == 0 ? 1U << output_test : 0U));
        changes.push_back(at);
        return at;
    }
};

struct TrainMoves final : OutputMoves {
    void moved(unsigned /*output*/, bool /*level*/, Nanoseconds /*asked*/,
               Nanoseconds /*left*/) override {}
};

/// Pulses of 20 us at a rate from 100 ms on.
struct TrainBench {
    explicit TrainBench(std::int64_t rate_hz, Nanoseconds now = 50 * ms) {
        clock.begin(100 * ms, 0);
        train.begin(output_test, Grid(0, rate_hz * 1'000'000), clock, 20'000, now);
    }
    void poll(Nanoseconds now) {
        train.poll(now);
        queue.commit(now);
    }

    TrainHardware hardware;
    TrainMoves moves;
    OutputQueue queue{hardware, moves, {}};
    GridClock clock;
    PulseTrain train{queue};
};

}  // namespace

TEST_CASE("pulse_train: each pulse is decided 1.2 ms before it leaves, at most") {
    TrainBench bench(100);
    CHECK(bench.train.next_wake() == 100 * ms - 700'000);
    bench.train.poll(100 * ms - 1'200'001);
    CHECK(bench.queue.empty());
    bench.train.poll(100 * ms - 1'200'000);
    CHECK(bench.train.next_wake() == 110 * ms - 700'000);
    bench.queue.commit(100 * ms);
    CHECK(bench.hardware.changes == std::vector<Nanoseconds>{100 * ms, 100 * ms + 20'000});
}

TEST_CASE("pulse_train: many are decided at once, as far as the output has room") {
    TrainBench bench(10'000);
    bench.train.poll(100 * ms - 700'000);
    CHECK(bench.train.next_wake() == 100 * ms + 600'000 - 700'000);
    bench.train.poll(100 * ms - 300'000);
    CHECK(bench.train.next_wake() == 101 * ms - 700'000);
    TrainBench faster(20'000);
    faster.train.poll(100 * ms - 400'000);
    CHECK_FALSE(faster.queue.has_room(output_test));
    CHECK(faster.train.next_wake() == 100 * ms + 600'000 - 700'000);
}

TEST_CASE("pulse_train: polled when it asks for it, it leaves no pulse out") {
    TrainBench bench(10'000);
    while (bench.hardware.changes.size() < 2'000) bench.poll(bench.train.next_wake());
    for (std::size_t i = 0; i < 2'000; ++i) {
        const Nanoseconds rise = 100 * ms + static_cast<Nanoseconds>(i / 2) * 100'000;
        REQUIRE(bench.hardware.changes[i] == rise + (i % 2 == 0 ? 0 : 20'000));
    }
}

TEST_CASE("pulse_train: pulses that could leave late are left out") {
    TrainBench on_time(1'000);
    on_time.poll(100 * ms - 400'000);
    CHECK(on_time.hardware.changes.at(0) == 100 * ms);
    TrainBench late(1'000);
    late.poll(100 * ms - 399'999);
    CHECK(late.hardware.changes.empty());
    CHECK(late.train.next_wake() == 101 * ms - 700'000);
    late.poll(104 * ms + 500'000);
    CHECK(late.hardware.changes.at(0) == 105 * ms);

    TrainBench begun_on_time(1'000, 107 * ms - 400'000);
    CHECK(begun_on_time.train.next_wake() == 107 * ms - 700'000);
    TrainBench begun_late(1'000, 107 * ms - 399'999);
    CHECK(begun_late.train.next_wake() == 108 * ms - 700'000);
    const Nanoseconds months = 10'000'000'000 * ms;  // are skipped in no time
    CHECK(TrainBench(10'000, months).train.next_wake() == months + 400'000 - 700'000);
}

TEST_CASE("pulse_train: it follows the clock that it is in") {
    TrainBench bench(100);
    bench.clock.begin(103 * ms, 0);
    CHECK(bench.train.next_wake() == 100 * ms - 700'000);
    bench.train.moved();
    CHECK(bench.train.next_wake() == 103 * ms - 700'000);
    bench.poll(103 * ms - 500'000);
    CHECK(bench.hardware.changes.at(0) == 103 * ms);
}

TEST_CASE("pulse_train: stopped, it sends nothing") {
    TrainBench bench(100);
    bench.train.stop();
    CHECK(bench.train.next_wake() == never);
    bench.train.moved();
    bench.train.poll(100 * ms);
    CHECK(bench.queue.empty());
    PulseTrain none(bench.queue);
    none.moved();
    CHECK(none.next_wake() == never);
}
