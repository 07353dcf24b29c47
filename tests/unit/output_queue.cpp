// SPDX-License-Identifier: BSD-3-Clause
#include "output_queue.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <utility>
#include <vector>

using namespace versavis::firmware;

namespace {

struct QueueHardware final : OutputSchedule {
    std::vector<std::pair<Nanoseconds, std::uint32_t>> words;
    std::size_t capacity = 100;
    Nanoseconds soonest = 0;  ///< that a word can leave

    Nanoseconds push(Nanoseconds at, std::uint32_t levels) override {
        if (words.size() == capacity) return never;
        words.emplace_back(std::max(at, soonest), levels);
        return words.back().first;
    }
};

struct Move {
    unsigned output;
    bool level;
    Nanoseconds asked;
    Nanoseconds left;
    bool operator==(const Move& other) const {
        return output == other.output && level == other.level && asked == other.asked &&
               left == other.left;
    }
};

struct MoveLog final : OutputMoves {
    std::vector<Move> all;
    void moved(unsigned output, bool level, Nanoseconds asked, Nanoseconds left) override {
        all.push_back({output, level, asked, left});
    }
};

struct QueueBench {
    explicit QueueBench(const PortFacts& facts = {}) : queue(hardware, moves, facts) {}
    QueueHardware hardware;
    MoveLog moves;
    OutputQueue queue;
};

using SentWords = std::vector<std::pair<Nanoseconds, std::uint32_t>>;

}  // namespace

TEST_CASE("output_queue: edges of all outputs leave in order, those of one instant in one word") {
    QueueBench bench;
    QueueHardware& hardware = bench.hardware;
    OutputQueue& queue = bench.queue;
    queue.set(200, 0, false);
    queue.set(100, 0, true);
    queue.set(100, 2, true);
    queue.set(150, 1, true);
    queue.commit(151 - OutputQueue::horizon);
    CHECK(hardware.words == SentWords{{100, 0b101}, {150, 0b111}});
    CHECK(queue.next_wake() == 200 - 500'000);
    CHECK(queue.commit(0));
    CHECK(hardware.words.back() == std::pair<Nanoseconds, std::uint32_t>{200, 0b110});
    CHECK(queue.next_wake() == never);
}

TEST_CASE("output_queue: what comes too late is put behind what is committed, and says so") {
    QueueBench bench;
    OutputQueue& queue = bench.queue;
    queue.set(100, 0, true);
    queue.commit(0);
    CHECK(queue.soonest(100) == 101);
    CHECK(queue.soonest(101) == 101);
    CHECK(queue.set(90, 1, true) == 101);
    CHECK(queue.set(300, 1, false) == 300);
    CHECK(queue.rest(0, true, 50) == 100);  // it is, or will be then
    CHECK(queue.rest(0, true, 200) == 200);
    CHECK(queue.rest(0, false, 50) == 101);
}

TEST_CASE("output_queue: a full hardware queue delays nothing but the commit") {
    QueueBench bench;
    QueueHardware& hardware = bench.hardware;
    OutputQueue& queue = bench.queue;
    hardware.capacity = 1;
    queue.set(1, 0, true);
    queue.set(2, 0, false);
    CHECK_FALSE(queue.commit(0));
    CHECK_FALSE(queue.empty());
    hardware.capacity = 2;
    queue.commit(0);
    CHECK(hardware.words == SentWords{{1, 1}, {2, 0}});
}

TEST_CASE("output_queue: cancelling leaves the output idle and the others alone") {
    QueueBench bench;
    QueueHardware& hardware = bench.hardware;
    OutputQueue& queue = bench.queue;
    queue.set(10, 0, true);
    queue.commit(11 - OutputQueue::horizon);
    queue.set(50, 0, false);
    queue.set(60, 0, true);
    queue.set(45, 1, true);
    CHECK(queue.rest(0, false, 20) == 20);
    CHECK(queue.has_room(0, 23));
    CHECK_FALSE(queue.has_room(0, 24));
    CHECK_FALSE(queue.cancel(3));
    CHECK(queue.commit(0));
    CHECK(hardware.words == SentWords{{10, 1}, {20, 0}, {45, 0b10}});
    CHECK(queue.cancel(1));
}

TEST_CASE("output_queue: a pulse that is late keeps its width and its distance, and is reported") {
    QueueBench bench;
    bench.queue.pulse(100'000, 0, true, 50'000);
    bench.queue.pulse(180'000, 0, true, 50'000);
    bench.hardware.soonest = 1'000'000;
    CHECK(bench.queue.commit(1'000'000));
    CHECK(bench.hardware.words ==
          SentWords{{1'000'000, 1}, {1'050'000, 0}, {1'060'000, 1}, {1'110'000, 0}});
    CHECK(bench.moves.all == std::vector<Move>{{0, true, 100'000, 1'000'000},
                                               {0, false, 150'000, 1'050'000},
                                               {0, true, 180'000, 1'060'000},
                                               {0, false, 230'000, 1'110'000}});
    CHECK(bench.queue.is_late(100'000, 1'000'000));
}

TEST_CASE("output_queue: a pulse whose rise left late is not cut by a word for another output") {
    QueueBench bench;
    bench.queue.pulse(100'000, 0, true, 10'000);
    bench.queue.pulse(110'000, 1, true, 10'000);
    bench.hardware.soonest = 105'000;
    CHECK(bench.queue.commit(200'000));
    // The fall of output 0 was due with the rise of output 1.
    CHECK(bench.hardware.words ==
          SentWords{{105'000, 0b01}, {110'000, 0b11}, {115'000, 0b10}, {120'000, 0b00}});
    CHECK(bench.moves.all ==
          std::vector<Move>{{0, true, 100'000, 105'000}, {0, false, 110'000, 115'000}});
}

TEST_CASE(
    "output_queue: words leave at multiples of the grain, a step apart, and that is not late") {
    PortFacts facts;
    facts.output_grain_bits = 3;
    facts.output_step = 24;
    QueueBench bench(facts);
    CHECK(bench.queue.set(0, 0, false) == 0);
    bench.queue.cancel(0);
    CHECK(bench.queue.soonest(0) == 0);
    CHECK(bench.queue.set(1'003, 0, true) == 1'000);
    CHECK(QueueBench(facts).queue.set(1'004, 0, true) == 1'008);
    CHECK(bench.queue.set(1'005, 1, true) == 1'008);
    CHECK(bench.queue.set(1'021, 2, true) == 1'024);
    bench.queue.set(2'000, 2, false);
    CHECK(bench.queue.commit(1'500 - OutputQueue::horizon));
    CHECK(bench.hardware.words == SentWords{{1'000, 0b001}, {1'024, 0b111}});
    CHECK(bench.moves.all == std::vector<Move>{{1, true, 1'008, 1'024}});
    CHECK_FALSE(bench.queue.is_late(1'008, 1'024));
    CHECK_FALSE(bench.queue.is_late(1'000, 1'024));
    CHECK(bench.queue.is_late(1'000, 1'025));
    CHECK(bench.queue.set(1'030, 3, true) == 1'048);

    QueueBench far(facts);
    for (const Nanoseconds at : {1'000, 1'008, 2'000}) far.queue.set(at, 0, at != 1'008);
    CHECK(far.queue.commit(1'500 - OutputQueue::horizon));
    CHECK(far.hardware.words == SentWords{{1'000, 1}, {1'024, 0}});
}

TEST_CASE("output_queue: what is due within a millisecond is committed, 16 words at a time") {
    QueueBench bench;
    bench.queue.set(OutputQueue::horizon, 0, true);
    bench.queue.set(OutputQueue::horizon + 1, 0, false);
    CHECK(bench.queue.next_wake() == 500'000);
    CHECK(bench.queue.commit(0));
    CHECK(bench.hardware.words.size() == 1);
    CHECK(bench.queue.next_wake() == 500'001);
    CHECK_FALSE(bench.queue.is_overdue(0, 1'000'001));
    CHECK(bench.queue.is_overdue(0, 1'000'002));
    CHECK_FALSE(bench.queue.is_overdue(1, 1'000'002));

    QueueBench busy;
    for (Nanoseconds at = 1; at <= 20; ++at) busy.queue.set(at, 7, at % 2 == 1);
    CHECK(busy.queue.commit(0));
    CHECK(busy.hardware.words.size() == 16);
    CHECK(busy.hardware.words.front() == std::pair<Nanoseconds, std::uint32_t>{1, 0b1000'0000});
    CHECK(busy.queue.commit(0));
    CHECK(busy.hardware.words.size() == 20);
    CHECK(busy.queue.next_wake() == never);
}

TEST_CASE("output_queue: each output has room of its own, that of all fits") {
    QueueBench bench;
    bench.hardware.capacity = 1000;
    const std::vector<unsigned> rooms = {24, 24, 24, 24, 4, 18, 24, 24};
    Nanoseconds at = 0;
    for (unsigned output = 0; output < rooms.size(); ++output) {
        for (unsigned edges = 0; edges < rooms[output]; ++edges) {
            CHECK(bench.queue.has_room(output, rooms[output] - edges));
            CHECK_FALSE(bench.queue.has_room(output, rooms[output] - edges + 1));
            at += 10;
            bench.queue.set(at, output, edges % 2 == 0);
        }
        CHECK(bench.queue.set(at - 4, output, true) == at - 4);  // sets nothing
    }
    CHECK(bench.queue.take_high_water() == 166);
    for (int i = 0; i < 11; ++i) CHECK(bench.queue.commit(0));
    CHECK(bench.queue.empty());
    CHECK(bench.hardware.words.size() == 166);
    CHECK(bench.hardware.words.back() == std::pair<Nanoseconds, std::uint32_t>{1660, 0});
    for (unsigned output = 0; output < rooms.size(); ++output)
        CHECK(bench.queue.has_room(output, rooms[output]));
    CHECK(bench.moves.all.empty());
}

TEST_CASE("output_queue: the most that waited is reported once") {
    QueueBench bench;
    for (Nanoseconds at = 1; at <= 3; ++at) bench.queue.set(at, 0, true);
    bench.queue.commit(2 - OutputQueue::horizon);
    CHECK(bench.queue.take_high_water() == 3);
    CHECK(bench.queue.take_high_water() == 1);
    bench.queue.set(10, 0, true);
    CHECK(bench.queue.take_high_water() == 2);
    CHECK(QueueBench().queue.take_high_water() == 0);
}

TEST_CASE("output_queue: of edges at one instant that need not last the last one counts") {
    QueueBench bench;
    bench.queue.set(100, 0, true);
    bench.queue.set(100, 0, false);
    bench.queue.set(100, 1, true);
    CHECK(bench.queue.commit(0));
    CHECK(bench.hardware.words == SentWords{{100, 0b10}});
}

TEST_CASE("output_queue: a late pulse puts off those behind it, at its own output alone") {
    QueueBench bench;
    bench.queue.pulse(100'000, 0, true, 50'000);
    bench.queue.pulse(120'000, 1, true, 100'000);
    bench.queue.pulse(160'000, 0, true, 50'000);
    bench.queue.pulse(300'000, 0, true, 50'000);
    bench.queue.set(165'000, 2, true);
    bench.hardware.soonest = 110'000;
    for (int i = 0; i < 3; ++i) CHECK(bench.queue.commit(400'000));
    CHECK(bench.hardware.words == SentWords{{110'000, 0b001},
                                            {120'000, 0b011},
                                            {160'000, 0b010},
                                            {165'000, 0b110},
                                            {170'000, 0b111},
                                            {220'000, 0b100},
                                            {300'000, 0b101},
                                            {350'000, 0b100}});
    CHECK(bench.moves.all == std::vector<Move>{{0, true, 100'000, 110'000},
                                               {0, false, 150'000, 160'000},
                                               {0, true, 160'000, 170'000},
                                               {0, false, 210'000, 220'000}});
}

TEST_CASE("output_queue: what is put off is passed by what waits at others, however late it is") {
    QueueBench bench;
    bench.queue.pulse(100'000, 0, true, 50'000);
    bench.queue.set(100'000, output_light_lead, true);
    bench.queue.set(120'000, 1, true);
    bench.hardware.soonest = 1'000'000;
    CHECK(bench.queue.commit(1'000'000));
    CHECK(bench.hardware.words ==
          SentWords{{1'000'000, 0b10'0001}, {1'000'001, 0b10'0011}, {1'050'000, 0b10'0010}});
}

TEST_CASE("output_queue: two edges of one output at one instant leave in two words") {
    QueueBench bench;
    bench.queue.pulse(20'000, 0, true, 10'000);
    bench.queue.set(30'000, 0, true, 1);
    CHECK(bench.queue.commit(0));
    CHECK(bench.hardware.words == SentWords{{20'000, 1}, {30'000, 0}, {30'001, 1}});
}

TEST_CASE("output_queue: a pulse of any width has both edges on the grain") {
    PortFacts facts;
    facts.output_grain_bits = 3;
    facts.output_step = 24;
    QueueBench bench(facts);
    bench.queue.pulse(80'000, 0, true, 1001);
    bench.queue.commit(0);
    CHECK(bench.hardware.words == SentWords{{80'000, 1}, {81'000, 0}});
}
