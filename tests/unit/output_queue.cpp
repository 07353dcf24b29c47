// SPDX-License-Identifier: BSD-3-Clause
#include "output_queue.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <utility>
#include <vector>

using namespace versavis::firmware;

namespace {

struct Hardware final : OutputSchedule {
    std::vector<std::pair<Nanoseconds, std::uint32_t>> words;
    std::size_t capacity = 100;

    bool push(Nanoseconds at, std::uint32_t levels) override {
        if (words.size() == capacity) return false;
        words.emplace_back(at, levels);
        return true;
    }
    bool take_late(Late& /*late*/) override { return false; }
};

using Words = std::vector<std::pair<Nanoseconds, std::uint32_t>>;

}  // namespace

TEST_CASE("output_queue: edges of all outputs leave in order, those of one instant in one word") {
    Hardware hardware;
    OutputQueue queue(hardware);
    queue.set(200, 0, false);
    queue.set(100, 0, true);
    queue.set(100, 2, true);
    queue.set(150, 1, true);
    queue.commit(151 - OutputQueue::horizon);
    CHECK(hardware.words == Words{{100, 0b101}, {150, 0b111}});
    CHECK(queue.next() == 200);
    CHECK(queue.commit(0));
    CHECK(hardware.words.back() == std::pair<Nanoseconds, std::uint32_t>{200, 0b110});
    CHECK(queue.next() == never);
}

TEST_CASE("output_queue: what comes too late is put behind what is committed, and says so") {
    Hardware hardware;
    OutputQueue queue(hardware);
    queue.set(100, 0, true);
    queue.commit(0);
    CHECK(queue.set(90, 1, true) == 101);
    CHECK(queue.set(300, 1, false) == 300);
    CHECK(queue.rest(0, false, 50) == 101);
}

TEST_CASE("output_queue: a full hardware queue delays nothing but the commit") {
    Hardware hardware;
    hardware.capacity = 1;
    OutputQueue queue(hardware);
    queue.set(1, 0, true);
    queue.set(2, 0, false);
    CHECK_FALSE(queue.commit(0));
    CHECK(queue.next() == 2);
    hardware.capacity = 2;
    queue.commit(0);
    CHECK(hardware.words == Words{{1, 1}, {2, 0}});
}

TEST_CASE("output_queue: cancelling leaves the output idle and the others alone") {
    Hardware hardware;
    OutputQueue queue(hardware);
    queue.set(10, 0, true);
    queue.commit(11 - OutputQueue::horizon);
    queue.set(50, 0, false);
    queue.set(60, 0, true);
    queue.set(55, 1, true);
    CHECK(queue.rest(0, false, 20) == 20);
    CHECK(queue.commit(0));
    CHECK(hardware.words == Words{{10, 1}, {20, 0}, {55, 0b10}});
}

TEST_CASE("output_queue: a pulse that is late keeps its width and its distance, and is told") {
    Hardware hardware;
    OutputQueue queue(hardware);
    queue.pulse(100'000, 0, true, 50'000);
    queue.pulse(180'000, 0, true, 50'000);
    CHECK(queue.commit(1'000'000));
    CHECK(hardware.words == Words{{1'000'000, 1}, {1'050'000, 0}, {1'060'000, 1}, {1'110'000, 0}});
    OutputSchedule::Late late{};
    std::vector<Nanoseconds> asked;
    while (queue.take_late(late)) asked.push_back(late.asked);
    std::sort(asked.begin(), asked.end());
    CHECK(asked == std::vector<Nanoseconds>{100'000, 150'000, 180'000, 230'000});
}
