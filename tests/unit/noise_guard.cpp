// SPDX-License-Identifier: BSD-3-Clause
#include "noise_guard.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "nanoseconds.hpp"

using namespace versavis::firmware;
using namespace versavis::test;

namespace {

constexpr std::uint32_t all_inputs = (1U << input_count) - 1;

struct EdgeLog final : EdgeStream {
    std::vector<std::uint32_t> listened;
    void listen(std::uint32_t inputs) override { listened.push_back(inputs); }
    bool pop(Edge& /*edge*/) override { return false; }
    Nanoseconds settled() override { return 0; }
    std::uint32_t take_lost() override { return 0; }
    versavis::wire::StampTest stamp_test() override { return {}; }
};

struct GuardBench {
    GuardBench() { guard.listen(all_inputs); }

    /// Returns how many edges of an input are taken, from `at` on, before one is too many.
    int taken(std::uint8_t input, Nanoseconds at, Nanoseconds spacing, int count) {
        for (int i = 0; i < count; ++i)
            if (!guard.take({at + i * spacing, input, true})) return i;
        return count;
    }

    EdgeLog edges;
    NoiseGuard guard{edges};
};

}  // namespace

TEST_CASE("noise_guard: an input with too many edges is ignored for a second, others are not") {
    const std::uint8_t input = GENERATE(as<std::uint8_t>{}, 0, 3, input_imu_ready,
                                        input_imu_ready + 1, input_pulse, 9, input_accel_ready);
    CAPTURE(int{input});
    const bool ready = input == 4 || input == 5 || input == 10;
    const int most = ready ? 160 : 128;
    GuardBench bench;
    const Nanoseconds at = 5 * second;
    CHECK(bench.taken(input, at, 1'000, most) == most);
    CHECK(bench.guard.next_wake() == never);
    CHECK(bench.edges.listened == std::vector<std::uint32_t>{all_inputs});
    const Nanoseconds last = at + ms;
    CHECK_FALSE(bench.guard.take({last, input, true}));
    CHECK(bench.edges.listened ==
          std::vector<std::uint32_t>{all_inputs, all_inputs & ~(1U << input)});
    CHECK(bench.guard.next_wake() == last + second);
    CHECK(bench.guard.take({last + 1, input, true}));  // stamped before it was switched off
    CHECK(bench.edges.listened.size() == 2);
    CHECK(bench.guard.next_wake() == last + second);

    bench.guard.poll(last + second - 1);
    CHECK(bench.edges.listened.size() == 2);
    bench.guard.poll(last + second);
    CHECK(bench.edges.listened ==
          std::vector<std::uint32_t>{all_inputs, all_inputs & ~(1U << input), all_inputs});
    CHECK(bench.guard.next_wake() == never);
    bench.guard.poll(last + 2 * second);
    CHECK(bench.edges.listened.size() == 3);
    CHECK(bench.taken(input, last + second, 1'000, 1'000) == most);
}

TEST_CASE("noise_guard: edges are counted within 10 ms, for each input") {
    for (const Nanoseconds early : {0, 1}) {
        GuardBench bench;
        CHECK(bench.taken(0, 10 * ms, 1'000, 128) == 128);
        CHECK(bench.taken(1, 10 * ms, 1'000, 128) == 128);
        CHECK(bench.guard.take({20 * ms - early, 0, true}) == (early == 0));
        CHECK(bench.guard.take({20 * ms, 1, true}));
    }
    GuardBench bench;
    CHECK(bench.taken(2, 10 * ms, 100'000, 10'000) == 10'000);
}

TEST_CASE("noise_guard: two inputs that are noisy are ignored together") {
    GuardBench bench;
    CHECK(bench.taken(0, second, 0, 1'000) == 128);
    CHECK(bench.taken(2, second + ms, 0, 1'000) == 128);
    CHECK(bench.edges.listened ==
          std::vector<std::uint32_t>{all_inputs, all_inputs & ~1U, all_inputs & ~5U});
    bench.guard.poll(2 * second);
    CHECK(bench.guard.next_wake() == 2 * second + ms);
    bench.guard.poll(2 * second + ms);
    CHECK(bench.edges.listened.back() == all_inputs);
}

TEST_CASE("noise_guard: before it listens to any input, none is ignored") {
    EdgeLog edges;
    CHECK(NoiseGuard(edges).next_wake() == never);
}

TEST_CASE("noise_guard: new inputs are listened to at once") {
    GuardBench bench;
    CHECK(bench.taken(0, second, 0, 1'000) == 128);
    bench.guard.listen(0b1001);
    CHECK(bench.edges.listened.back() == 0b1001);
    CHECK(bench.guard.next_wake() == never);
    CHECK(bench.taken(3, 2 * second, 0, 1'000) == 128);
    CHECK(bench.edges.listened.back() == 0b0001);
}

TEST_CASE("noise_guard: a pulse too close to the one before is its echo") {
    EchoFilter filter(1'000);
    CHECK(filter.take(0));
    CHECK_FALSE(filter.take(999));
    CHECK_FALSE(filter.take(999));
    CHECK(filter.take(1'000));
    CHECK_FALSE(filter.take(1'999));
    CHECK(filter.take(5'000));
}
