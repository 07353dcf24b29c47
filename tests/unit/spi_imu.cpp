// SPDX-License-Identifier: BSD-3-Clause
#include "imu/spi_imu.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <vector>

#include "nanoseconds.hpp"

using namespace versavis;
using namespace versavis::firmware;
using namespace versavis::test;

namespace {

constexpr std::uint16_t while_running = 0xFFFF;

struct SpiEvent {
    wire::BoardEventKind kind;
    Nanoseconds at;
    std::int64_t value;
    std::uint16_t detail;
    bool operator==(const SpiEvent& other) const {
        return kind == other.kind && at == other.at && value == other.value &&
               detail == other.detail;
    }
};

struct SpiReports final : ChannelReports {
    void exposure(const wire::Exposure& /*record*/) override {}
    void event(wire::BoardEventKind kind, std::uint8_t /*source*/, Nanoseconds at,
               std::int64_t value, std::uint16_t detail) override {
        events.push_back({kind, at, value, detail});
    }
    void exposure_planned(std::uint8_t /*camera*/, Nanoseconds /*start*/,
                          Nanoseconds /*duration*/) override {}

    std::size_t count(wire::BoardEventKind kind) const {
        return static_cast<std::size_t>(
            std::count_if(events.begin(), events.end(),
                          [kind](const SpiEvent& event) { return event.kind == kind; }));
    }
    std::vector<SpiEvent> events;
};

/// A bus with a part that answers what its set-up expects; the test says when.
struct Bus final : firmware::ImuBus {
    bool arm(const ImuJob& wanted) override {
        if (!accepts) return false;
        job = wanted;
        taken = 0;
        armed = true;
        done = false;
        return true;
    }
    bool take_reply(ImuReply& reply) override {
        if (!armed || !done) return false;
        reply = answers[taken++];
        if (taken == job.count) armed = done = false;
        return true;
    }
    void disarm() override { armed = done = false; }

    /// The job starts at `at`; its transfers follow each other.
    void run(Nanoseconds at) {
        REQUIRE(armed);
        for (unsigned i = 0; i < job.count; ++i, at += length) {
            answers[i] = {};
            answers[i].started = at;
            answers[i].ended = at + length;
            answers[i].refused = (refused >> i & 1U) != 0;
            if (kind == wire::ImuKind::adis16445)
                answer_words(job.transfers[i], answers[i].bytes);
            else
                answer_bytes(job.transfers[i], answers[i].bytes);
        }
        done = true;
    }
    void answer_bytes(const ImuTransfer& asked, std::uint8_t* bytes) {
        const std::uint8_t address = asked.bytes[0] & 0x7FU;
        if (asked.size == 2 && asked.bytes[0] == address) registers[address] = asked.bytes[1];
        if (kind == wire::ImuKind::bmi088) {
            if (asked.chip == 0 && address == 0x00) {
                bytes[1] = 0x0F;
                bytes[3] = ++counter;
            }
            if (asked.chip == 0 && address == 0x10) bytes[1] = 0x80U | registers[address] % 256U;
            if (asked.chip == 1 && address == 0x00) bytes[2] = 0x1E;
            if (asked.chip == 1 && address == 0x7C) bytes[3] = 0x04;
            return;
        }
        if (address == 0x75) bytes[1] = 0x47;
        if (address == 0x4E) bytes[1] = lives ? 0x0F : 0x00;
        if (address == 0x1D) {
            bytes[9] = ++counter;
            bytes[1 + 16] = fresh ? 0x08 : 0x00;
        }
    }
    void answer_words(const ImuTransfer& asked, std::uint8_t* bytes) {
        const std::uint8_t address = asked.bytes[0] & 0x7FU;
        if (asked.size != 4) {
            bytes[5] = updates > 0 ? ++counter : counter;  // of the first axis
            if (updates > 0) --updates;
        } else if (asked.bytes[0] != address) {
            registers[address] = static_cast<std::uint16_t>(asked.bytes[3] << 8U | asked.bytes[1]);
        } else {
            const unsigned value = address == 0x56 ? 16445U : registers[address];
            bytes[2] = static_cast<std::uint8_t>(value >> 8U);
            bytes[3] = static_cast<std::uint8_t>(value);
        }
    }

    wire::ImuKind kind = wire::ImuKind::icm42688p;
    ImuJob job;
    ImuReply answers[max_transfers];
    std::map<std::uint8_t, unsigned> registers;
    Nanoseconds length = 10 * us;
    unsigned taken = 0;
    std::uint8_t counter = 0;
    unsigned updates = 0;  ///< readings to come that find other words
    unsigned refused = 0;  ///< bit mask of transfers
    bool accepts = true;
    bool fresh = true;
    bool lives = true;
    bool armed = false;
    bool done = false;
};

/// Configured, and asked to do what is due only by the test.
struct SpiBench {
    explicit SpiBench(unsigned options = wire::imu_data_ready, std::uint32_t rate = 1'000'000,
                      wire::ImuKind kind = wire::ImuKind::icm42688p, Nanoseconds at = 0)
        : now(at) {
        bus.kind = kind;
        imu.configure({kind, 0, static_cast<std::uint8_t>(options), 0, rate}, now);
    }

    /// All edges before now are known. True: there was a sample.
    bool step() {
        imu.collect(now);
        return imu.poll(now, now, sample);
    }
    bool step(Nanoseconds at) {
        now = at;
        return step();
    }
    /// The step of the set-up that is due.
    void set_up_once() {
        if (!bus.armed) step(imu.next_wake(0));
        bus.run(now);
        step(now + 70 * us);
    }
    bool is_running() const { return reports.count(wire::BoardEventKind::imu_ready) > 0; }

    SpiReports reports;
    Bus bus;
    SpiImu imu{0, bus, reports};
    Nanoseconds now = 0;
    wire::ImuSample sample{};
};

/// Set up and waiting for its first edge, or grid point.
struct RunningSpi : SpiBench {
    explicit RunningSpi(unsigned options = wire::imu_data_ready, std::uint32_t rate = 1'000'000,
                        wire::ImuKind kind = wire::ImuKind::icm42688p)
        : SpiBench(options, rate, kind) {
        while (!is_running()) {
            REQUIRE(now < 2 * second);
            set_up_once();
        }
        if ((options & wire::imu_data_ready) == 0) return;
        REQUIRE(bus.armed);
        REQUIRE(bus.job.input == input_imu_ready);
    }

    void edge(Nanoseconds at) { imu.ready_edge(at, now); }
    /// An edge a millisecond later, and its reading `late` after it.
    bool read(Nanoseconds late = 1'000) {
        now += ms;
        edge(now);
        const Nanoseconds at = now;
        bus.run(at + late);
        const bool taken = step(at + late + 3 * bus.length + 20 * us);
        now = at;
        return taken;
    }
};

}  // namespace

TEST_CASE("spi_imu: set-up begins when the slowest part has powered up") {
    for (const Nanoseconds at : {Nanoseconds{0}, 300 * ms - 1, 300 * ms, 4 * second}) {
        SpiBench bench(wire::imu_data_ready, 1'000'000, wire::ImuKind::icm42688p, at);
        const Nanoseconds begins = std::max(at, 300 * ms);
        CHECK(bench.imu.next_wake(0) == begins);
        if (at < begins) bench.step(begins - 1);
        CHECK_FALSE(bench.bus.armed);
        bench.step(begins);
        REQUIRE(bench.bus.armed);
        CHECK(bench.bus.job.input == not_routed);
        CHECK(bench.bus.job.after == begins);
        CHECK(bench.bus.job.count == 1);
        // Its reset, and the pause that it needs.
        CHECK(bench.bus.job.transfers[0].bytes[0] == 0x11);
        bench.bus.run(begins);
        bench.step(begins + us);
        CHECK(bench.imu.next_wake(0) == begins + us + 2 * ms);
        bench.step(begins + us + 2 * ms - 1);
        CHECK_FALSE(bench.bus.armed);
        bench.step(begins + us + 2 * ms);
        CHECK(bench.bus.armed);
        CHECK(bench.reports.events.empty());
    }
}

TEST_CASE("spi_imu: what goes wrong in set-up is reported, with the step, and tried again") {
    enum class Fault { held, hangs, refused, wrong };
    for (const Fault fault : {Fault::held, Fault::hangs, Fault::refused, Fault::wrong}) {
        SpiBench bench;
        bench.set_up_once();
        bench.now = bench.imu.next_wake(0);
        bench.bus.accepts = fault != Fault::held;
        bench.bus.refused = fault == Fault::refused ? 1 : 0;
        bench.bus.kind = fault == Fault::wrong ? wire::ImuKind::bmi088 : bench.bus.kind;
        bench.step();
        const Nanoseconds asked = bench.now;
        if (fault == Fault::hangs) {
            CHECK(bench.imu.next_wake(0) == asked + 25 * ms);
            bench.step(asked + 25 * ms - 1);
            CHECK(bench.reports.events.empty());
            bench.step(asked + 25 * ms);
        } else if (fault != Fault::held) {
            bench.bus.run(bench.now);
            bench.step(asked + us);
        }
        const bool wrong = fault == Fault::wrong;
        const SpiEvent event{
            wrong ? wire::BoardEventKind::imu_failed : wire::BoardEventKind::imu_silent, bench.now,
            0, fault == Fault::hangs ? while_running : std::uint16_t{1}};
        CHECK(bench.reports.events == std::vector<SpiEvent>{event});
        CHECK_FALSE(bench.bus.armed);
        CHECK(bench.imu.restarts() == 1);
        CHECK(bench.imu.next_wake(0) == bench.now + second);
        bench.bus.accepts = true;
        bench.bus.refused = 0;
        bench.bus.kind = wire::ImuKind::icm42688p;
        bench.step(bench.now + second);
        REQUIRE(bench.bus.armed);
        CHECK(bench.bus.job.transfers[0].bytes[0] == 0x11);  // from the first step
    }
}

TEST_CASE("spi_imu: a part that is set up says who it is, and must show edges in time") {
    for (const std::uint32_t rate : {1'000'000U, 12'500U}) {
        RunningSpi world(wire::imu_data_ready, rate);
        const Nanoseconds began = world.now;
        CHECK(world.reports.events ==
              std::vector<SpiEvent>{{wire::BoardEventKind::imu_ready, began, 0x47, 0}});
        CHECK(world.bus.job.after == began);
        CHECK(world.bus.job.count == 2);
        CHECK(world.bus.job.pause == 0);
        const Nanoseconds patience = 100 * ms + 20'000 * second / rate;
        CHECK(world.imu.next_wake(0) == began + patience);
        // An edge is waited for anew, from when it is known; its reading must end in time.
        world.now += 50 * ms;
        world.edge(world.now - us);
        CHECK(world.imu.next_wake(0) == world.now + 25 * ms);
        world.bus.run(world.now);
        CHECK(world.step(world.now + 100 * us));
        CHECK(world.imu.next_wake(0) == began + 50 * ms + patience);
        world.step(began + 50 * ms + patience - 1);
        CHECK(world.reports.events.size() == 1);
        world.step(began + 50 * ms + patience);
        CHECK(world.reports.events.back() ==
              SpiEvent{wire::BoardEventKind::imu_silent, world.now, 0, while_running});
        CHECK_FALSE(world.bus.armed);
        CHECK(world.imu.next_wake(0) == world.now + second);
        world.step(world.now + second);
        CHECK(world.bus.armed);
        CHECK(world.bus.job.input == not_routed);
    }
}

TEST_CASE("spi_imu: a reading that does not end sets the part up again, whatever edges come") {
    RunningSpi world;
    const Nanoseconds began = world.now;
    for (int i = 0; i < 25; ++i, world.now += ms) {
        world.edge(world.now);
        world.step();
        CHECK(world.imu.next_wake(0) == began + 25 * ms);
    }
    CHECK(world.reports.events.size() == 1);
    world.step();
    CHECK(world.reports.events.back() ==
          SpiEvent{wire::BoardEventKind::imu_silent, began + 25 * ms, 0, while_running});
}

TEST_CASE("spi_imu: what edges showed before the part was set up means nothing") {
    SpiBench world;
    for (int i = 0; i < 6; ++i) world.set_up_once();
    for (Nanoseconds at = world.now - 20 * ms; at < world.now; at += 400 * us)
        world.imu.ready_edge(at, at);  // too fast
    world.imu.edges_lost();
    while (!world.is_running()) world.set_up_once();
    world.step();
    CHECK(world.reports.events.size() == 1);
    REQUIRE(world.bus.armed);
    CHECK(world.bus.job.after == world.now);
    world.now += 10 * ms;
    world.imu.ready_edge(world.now, world.now);
    world.bus.run(world.now + us);
    REQUIRE(world.step(world.now + 100 * us));
    CHECK(world.sample.number == 0);
    CHECK(world.sample.flags == wire::imu_stamped);
}

TEST_CASE("spi_imu: edges count as too fast from when the part was set up") {
    SpiBench world;
    for (int i = 0; i < 9; ++i) world.set_up_once();
    world.step(world.imu.next_wake(0));
    world.bus.run(world.now);
    for (Nanoseconds at = world.now - 20 * ms; at <= world.now; at += 400 * us)
        world.imu.ready_edge(at, at);
    world.step();
    REQUIRE(world.is_running());
    const Nanoseconds began = world.now;
    for (Nanoseconds i = 1; i <= 20; ++i) {
        CHECK(world.reports.count(wire::BoardEventKind::imu_failed) == 0);
        world.imu.ready_edge(began + i * 400 * us, began + i * 400 * us);
        world.step(began + i * 400 * us);
    }
    CHECK(world.reports.count(wire::BoardEventKind::imu_failed) == 1);
}

TEST_CASE("spi_imu: neither the newest edge nor its echoes start a reading") {
    RunningSpi world;
    REQUIRE(world.read());
    CHECK(world.sample.kind == wire::ImuKind::icm42688p);
    CHECK(world.sample.time_ns == world.now);
    CHECK(world.bus.job.after == world.now + 100'000 - 1);  // the most that an echo is late
    // A late echo is not one of the edges, and nothing starts at it either.
    world.edge(world.now + 99'000);
    CHECK(world.imu.take_glitches() == 1);
    CHECK(world.imu.next_wake(0) > world.now + 100 * ms);
    REQUIRE(world.read());
    CHECK(world.sample.flags == wire::imu_stamped);
    // One that came after the echoes of the one before.
    world.now += ms;
    world.edge(world.now);
    world.bus.run(world.now);
    world.edge(world.now + 99'999);
    world.edge(world.now + 100'000);
    world.edge(world.now + 150'000);
    REQUIRE(world.step(world.now + 200'000));
    CHECK(world.bus.job.after == world.now - 200'000 + 199'999);
}

TEST_CASE("spi_imu: a reading gives its sample once all edges before it are known") {
    RunningSpi world;
    world.now += ms;
    world.edge(world.now);
    world.bus.run(world.now + 7 * us);  // its second transfer starts 10 us later
    world.imu.collect(world.now + 30 * us);
    const Nanoseconds started = world.now + 17 * us;
    CHECK(world.imu.next_wake(0) == started + 1);
    CHECK(world.imu.next_wake(4 * us) == started + 1 + 4 * us);
    CHECK_FALSE(world.imu.poll(world.now + 40 * us, started, world.sample));
    CHECK(world.imu.poll(world.now + 40 * us, started + 1, world.sample));
    CHECK_FALSE(world.imu.poll(world.now + 50 * us, started + 1, world.sample));
}

TEST_CASE("spi_imu: a second reading of the same data gives no sample") {
    RunningSpi world;
    REQUIRE(world.read());
    const std::uint32_t number = world.sample.number;
    world.bus.run(world.now + 200'000);
    CHECK_FALSE(world.step(world.now + 300'000));
    world.now -= 300'000;
    REQUIRE(world.read());
    CHECK(world.sample.number == number + 1);
    CHECK(world.sample.flags == wire::imu_stamped);
}

TEST_CASE("spi_imu: edges whose data was not read are missing samples") {
    RunningSpi world;
    REQUIRE(world.read(0));  // an edge at the very start of the reading is its edge
    CHECK(world.sample.time_ns == world.now);
    for (int i = 0; i < 3; ++i) {
        world.now += ms;
        world.edge(world.now);
    }
    REQUIRE(world.read());
    CHECK(world.sample.number == 4);
    CHECK(world.sample.flags == (wire::imu_stamped | wire::imu_overrun));
    // When the bus takes no job the number of its sample is missing.
    world.bus.accepts = false;
    world.edge(world.now += ms);
    world.bus.run(world.now);
    CHECK(world.step(world.now + 50 * us));
    CHECK(world.sample.number == 5);
    world.bus.accepts = true;
    world.step();
    REQUIRE(world.bus.armed);
    world.now -= 50 * us;
    REQUIRE(world.read());
    CHECK(world.sample.number == 7);
    CHECK(world.sample.flags == (wire::imu_stamped | wire::imu_overrun));
}

TEST_CASE("spi_imu: a reading whose edge is not known gives no sample, and the next one says so") {
    RunningSpi world;
    REQUIRE(world.read());
    const std::uint32_t number = world.sample.number;
    const Nanoseconds before = world.sample.time_ns;
    world.now += ms;
    world.edge(world.now);  // it is known, but not that of the reading
    world.now += 2 * ms;    // two edges came and were lost; the reading is that of the last
    world.imu.edges_lost();
    world.bus.run(world.now + 1'000);
    CHECK_FALSE(world.step(world.now + 50'000));
    world.now -= 50'000;
    REQUIRE(world.read());
    CHECK(world.sample.time_ns == before + 4 * ms);
    CHECK(world.sample.number == number + 4);
    CHECK((world.sample.flags & wire::imu_overrun) != 0);
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_overrun) == 0);
}

TEST_CASE("spi_imu: an edge after a reading is not its own, if that was lost") {
    RunningSpi world;
    REQUIRE(world.read());
    world.imu.edges_lost();
    world.now += ms;
    world.bus.run(world.now);
    world.edge(world.now + 40 * us);
    CHECK_FALSE(world.step(world.now + 100 * us));
    world.bus.run(world.now);
    CHECK(world.step(world.now + 100 * us));
    CHECK(world.sample.number == 1);
}

TEST_CASE("spi_imu: how many edges were lost follows from the period, unless more are known") {
    struct Case {
        Nanoseconds later;  ///< the edge that is read, after the one read before
        unsigned known;     ///< edges up to it, 800 us apart
        std::uint32_t numbers;
    };
    for (const Case& made :
         {Case{1'400 * us, 1, 1}, Case{1'500 * us - 1, 1, 1}, Case{1'500 * us, 1, 2},
          Case{7'499'999, 1, 7}, Case{4 * ms, 5, 5}, Case{4 * ms, 3, 4}}) {
        RunningSpi world;
        REQUIRE(world.read());
        const Nanoseconds before = world.now;
        world.imu.edges_lost();
        world.now = before + made.later;
        for (unsigned i = made.known; i > 0; --i) world.edge(world.now - (i - 1) * 800 * us);
        world.bus.run(world.now);
        REQUIRE(world.step(world.now + 100 * us));
        CHECK(world.sample.number == made.numbers);
        CHECK(((world.sample.flags & wire::imu_overrun) != 0) == (made.numbers > 1));
        // That is over.
        world.now = before + made.later + 3 * ms;
        world.edge(world.now);
        world.bus.run(world.now);
        REQUIRE(world.step(world.now + 100 * us));
        CHECK(world.sample.number == made.numbers + 1);
    }
    // Before the first sample, since the part was set up.
    RunningSpi world;
    world.imu.edges_lost();
    world.now += 4 * ms;
    world.edge(world.now);
    world.bus.run(world.now);
    REQUIRE(world.step(world.now + 100 * us));
    CHECK(world.sample.number == 3);
}

TEST_CASE("spi_imu: new data within a reading spoils it, within its check it does not") {
    for (const Nanoseconds after_end : {-1, 0, 1, 9'999}) {
        RunningSpi world;
        REQUIRE(world.read());
        world.now += ms;
        world.edge(world.now);
        world.bus.run(world.now + 995'000);
        const Nanoseconds ended = world.now + 995'000 + 10 * us;
        world.edge(ended + after_end);
        CHECK(world.step(ended + 50 * us) == (after_end > 0));
        CHECK(world.imu.errors() == (after_end > 0 ? 0 : 1));
        CHECK(world.reports.events.size() == 1);
        if (after_end > 0) continue;
        // The data is that of the new edge; its sample is read at the next one.
        world.now = ended;
        REQUIRE(world.read());
        CHECK(world.sample.number == 3);
        CHECK((world.sample.flags & wire::imu_overrun) != 0);
    }
}

TEST_CASE("spi_imu: twenty bad readings in a row set the part up again") {
    enum class Bad { first_refused, second_refused, spoiled, check_failed };
    for (const Bad bad :
         {Bad::first_refused, Bad::second_refused, Bad::spoiled, Bad::check_failed}) {
        RunningSpi world;
        const auto fails = [&world, bad](int times) {
            world.bus.refused = bad == Bad::first_refused ? 1 : bad == Bad::second_refused ? 2 : 0;
            world.bus.lives = bad != Bad::check_failed;
            for (; times > 0; --times) {
                world.edge(world.now += ms);
                world.bus.run(world.now + (bad == Bad::spoiled ? 995 * us : us));
                if (bad == Bad::spoiled) world.edge(world.now += ms);
                CHECK(world.step(world.now + 50 * us) == (bad == Bad::check_failed));
                world.now -= 50 * us;
            }
            world.bus.refused = 0;
            world.bus.lives = true;
        };
        fails(19);
        REQUIRE(world.read());
        fails(19);
        CHECK(world.reports.events.size() == 1);
        fails(1);
        CHECK(world.imu.errors() == 39);
        CHECK(world.imu.restarts() == 1);
        REQUIRE(world.reports.events.size() == 2);
        const bool silent = bad == Bad::first_refused || bad == Bad::second_refused;
        CHECK(world.reports.events[1].kind ==
              (silent ? wire::BoardEventKind::imu_silent : wire::BoardEventKind::imu_failed));
        CHECK(world.reports.events[1].value == 0);
        CHECK(world.reports.events[1].detail == while_running);
        CHECK_FALSE(world.bus.armed);
    }
}

TEST_CASE("spi_imu: edges that come too fast set the part up again") {
    const auto edges = [](RunningSpi& world, int count, Nanoseconds apart) {
        for (; count > 0; --count) {
            world.edge(world.now += apart);
            world.bus.run(world.now);
            world.step(world.now + 50 * us);
            world.now -= 50 * us;
        }
    };
    RunningSpi world;
    edges(world, 1, ms);
    edges(world, 19, 750 * us - 1);
    edges(world, 1, 750 * us);
    edges(world, 19, 750 * us - 1);
    CHECK(world.reports.events.size() == 1);
    edges(world, 1, 750 * us - 1);
    CHECK(world.reports.events.back() ==
          SpiEvent{wire::BoardEventKind::imu_failed, world.now + 50 * us, 0, while_running});
    CHECK_FALSE(world.bus.armed);
}

TEST_CASE("spi_imu: on I2C a part is read at its address, as fast as the bus allows") {
    RunningSpi world(wire::imu_data_ready | wire::imu_i2c | wire::imu_i2c_second);
    CHECK(world.bus.registers[0x4F] == 6);  // written while it was set up
    for (unsigned i = 0; i < 2; ++i) {
        CHECK(world.bus.job.transfers[i].bus == ImuTransfer::Bus::i2c_read);
        CHECK(world.bus.job.transfers[i].chip == 0x69);
        CHECK(world.bus.job.transfers[i].bytes[0] == (i == 0 ? 0x1D : 0x4E));
        CHECK(world.bus.job.transfers[i].clock_hz == 400'000);
    }
    SpiBench first(wire::imu_data_ready | wire::imu_i2c);
    first.step(300 * ms);
    CHECK(first.bus.job.transfers[0].bus == ImuTransfer::Bus::i2c_write);
    CHECK(first.bus.job.transfers[0].chip == 0x68);
    CHECK(first.bus.job.transfers[0].bytes[0] == 0x11);
    SpiBench spi;
    spi.step(300 * ms);
    CHECK(spi.bus.job.transfers[0].bus == ImuTransfer::Bus::spi);
    CHECK(spi.bus.job.transfers[0].chip == 0);
    CHECK(spi.bus.job.transfers[0].clock_hz == 20'000'000);
}

TEST_CASE("spi_imu: a sample is repeated when the part or its words say so") {
    RunningSpi world;
    REQUIRE(world.read());
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_repeated) == 0);
    world.bus.fresh = false;
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_repeated) != 0);
    world.bus.fresh = true;
    --world.bus.counter;
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_repeated) != 0);
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_repeated) == 0);
}

TEST_CASE(
    "spi_imu: readings that differ are compared with one more, and the first of the two counts") {
    RunningSpi world(wire::imu_data_ready, 819'200, wire::ImuKind::adis16445);
    CHECK(world.bus.job.pause == 25'000);
    world.bus.updates = 1;
    REQUIRE(world.read());
    // Of three readings the last two agree: the first of these has the data.
    world.now += ms;
    world.edge(world.now);
    world.bus.updates = 2;
    world.bus.run(world.now + 2 * us);
    CHECK_FALSE(world.step(world.now + 30 * us));
    CHECK(world.bus.job.input == not_routed);
    CHECK(world.bus.job.after == world.now);
    CHECK(world.bus.job.count == 1);
    CHECK(world.imu.next_wake(0) == world.now + 25 * ms);
    const Nanoseconds second_ended = world.now - 30 * us + 22 * us;
    world.bus.run(world.now);
    // New data after the first of these two was read, and before the second.
    world.edge(second_ended + 200 * us);
    CHECK(world.step(world.now + 400 * us));
    CHECK(world.sample.flags == wire::imu_stamped);
    CHECK(world.sample.number == 1);
    CHECK(world.bus.job.input == input_imu_ready);
    CHECK(world.bus.job.count == 2);
    CHECK(world.bus.job.transfers[0].size == 18);
    CHECK(world.bus.job.transfers[1].size == 18);
    // Five that differ fail.
    world.now += ms;
    world.edge(world.now);
    world.bus.updates = 5;
    world.bus.run(world.now);
    for (int i = 0; i < 3; ++i) {
        CHECK_FALSE(world.step(world.now + 30 * us));
        world.bus.run(world.now);
    }
    CHECK(world.step(world.now + 30 * us));
    CHECK((world.sample.flags & wire::imu_check_failed) != 0);
    // When the bus does not take one more, the next sample begins anew.
    world.now += ms;
    world.edge(world.now);
    world.bus.updates = 2;
    world.bus.run(world.now);
    world.bus.accepts = false;
    CHECK_FALSE(world.step(world.now + 30 * us));
    world.bus.accepts = true;
    world.bus.updates = 0;
    world.step(world.now + us);
    CHECK(world.bus.job.count == 2);
    world.now += ms;
    world.edge(world.now);
    world.bus.updates = 4;
    world.bus.run(world.now);
    for (int i = 0; i < 3; ++i) {
        CHECK_FALSE(world.step(world.now + 30 * us));
        world.bus.run(world.now);
    }
    CHECK(world.step(world.now + 30 * us));
    CHECK(world.sample.flags == (wire::imu_stamped | wire::imu_overrun));
}

TEST_CASE(
    "spi_imu: the age of the accelerometer's values is reported when its edge is beyond doubt") {
    // One byte takes a microsecond; these are the accelerometer's, with a margin of two.
    constexpr Nanoseconds period = 625 * us;
    constexpr Nanoseconds first = (20 - 2) * us;
    constexpr Nanoseconds end = (26 + 2) * us;
    constexpr Nanoseconds off = period / 16;
    constexpr std::int16_t unknown = 0;
    const auto age = [](Nanoseconds at) { return static_cast<std::int16_t>(-at / 32); };
    struct Case {
        std::vector<Nanoseconds> edges;  ///< from when the reading started, as did the gyro's edge
        std::int16_t reported;
    };
    const Case cases[] = {
        {{-100 * us - period, -100 * us}, age(-100 * us)},
        {{-100 * us}, unknown},
        {{}, unknown},
        {{first - period, first}, age(first)},
        {{first + 1 - period, first + 1}, unknown},
        {{first + 1 - 2 * period, first + 1 - period, first + 1}, unknown},
        {{end - 2 * period, end - period, end}, unknown},
        {{end + 1 - 2 * period, end + 1 - period, end + 1}, age(end + 1 - period)},
        {{end - 2 * period, end - period}, unknown},  // one may have come, and be lost
        {{end + 1 - 2 * period, end + 1 - period}, age(end + 1 - period)},
        {{-100 * us - period - off, -100 * us}, age(-100 * us)},
        {{-100 * us - period - off - 1, -100 * us}, unknown},
        {{-100 * us - period + off, -100 * us}, age(-100 * us)},
        {{-100 * us - period + off + 1, -100 * us}, unknown},
        // One that came sooner than it was due.
        {{end - 2 * period + off / 2, end - period + off / 2, end}, unknown},
        {{end - 2 * period + off / 2, end - period + off / 2, end + 1},
         age(end - period + off / 2)},
        {{first + 1 - 2 * period + off, first + 1 - period + off, first + 1}, unknown},
        {{-100 * us - period, -100 * us, -100 * us + period / 8 - 1}, age(-100 * us)},  // an echo
    };
    for (const unsigned options :
         {wire::imu_data_ready | wire::imu_accel_ready, wire::imu_data_ready | 0})
        for (const Case& made : cases) {
            RunningSpi world(options, 1'000'000, wire::ImuKind::bmi088);
            world.bus.length = 38 * us;
            world.now += ms;
            const Nanoseconds at = world.now;
            world.edge(at - 38 * us);
            world.bus.run(at - 38 * us);  // the gyro is read first
            for (const Nanoseconds edge : made.edges) world.imu.accel_edge(at + edge);
            REQUIRE(world.step(at + ms / 2));
            const bool known = made.reported != unknown && (options & wire::imu_accel_ready) != 0;
            const std::int16_t gyro_later = -38'000 / 32;
            CHECK(((world.sample.flags & wire::imu_accel_stamped) != 0) == known);
            CHECK(std::abs(world.sample.accel_age - (known ? made.reported + gyro_later : 0)) <= 1);
        }
}

TEST_CASE("spi_imu: an age of the accelerometer's values that does not fit is not reported") {
    for (const Nanoseconds age : {-32'768 * 32LL, -32'769 * 32LL}) {
        RunningSpi world(wire::imu_data_ready | wire::imu_accel_ready, 100'000,
                         wire::ImuKind::bmi088);
        world.now += 10 * ms;
        world.edge(world.now);
        world.bus.run(world.now - age);  // late
        world.imu.accel_edge(world.now - age - 625 * us);
        world.imu.accel_edge(world.now - age);
        REQUIRE(world.step(world.now + 2 * ms));
        CHECK(((world.sample.flags & wire::imu_accel_stamped) != 0) == (age >= -32'768 * 32LL));
        CHECK(world.sample.accel_age == (age >= -32'768 * 32LL ? -32'768 : 0));
    }
}

TEST_CASE("spi_imu: after lost edges of the accelerometer two are needed again") {
    RunningSpi world(wire::imu_data_ready | wire::imu_accel_ready, 1'000'000,
                     wire::ImuKind::bmi088);
    world.imu.accel_edge(world.now + 200 * us);
    world.imu.edges_lost();
    world.imu.accel_edge(world.now + 825 * us);
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_accel_stamped) == 0);
    world.imu.accel_edge(world.now + 450 * us);
    world.imu.accel_edge(world.now + 460 * us);
    CHECK(world.imu.take_glitches() == 1);
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_accel_stamped) != 0);
}

TEST_CASE("spi_imu: without data-ready it is read at grid points, from a part much faster") {
    RunningSpi world(0, 1'000'000);
    CHECK(world.bus.registers[0x4F] == 4);                   // 4 kHz
    CHECK(RunningSpi(0, 250'000).bus.registers[0x4F] == 6);  // 1 kHz
    CHECK(RunningSpi(0, 300'000).bus.registers[0x4F] == 5);  // 2 kHz
    // The grid began half a millisecond after the configuration.
    const Nanoseconds next = world.imu.grid().next();
    CHECK(next % ms == 500 * us);
    CHECK(next >= world.now + 500 * us);
    CHECK(next < world.now + 1'500 * us);
    CHECK(world.imu.next_wake(0) == next - 500 * us);
    world.imu.ready_edge(world.now, world.now);  // a line that is not wired
    world.step(next - 500 * us - 1);
    CHECK_FALSE(world.bus.armed);
    world.step(next - 500 * us);
    REQUIRE(world.bus.armed);
    CHECK(world.bus.job.input == not_routed);
    CHECK(world.bus.job.after == next);
    CHECK(world.bus.job.count == 2);
    CHECK(world.imu.next_wake(0) == next + 500 * us);
    world.bus.run(next + 2 * us);
    REQUIRE(world.step(next + 30 * us));
    CHECK(world.sample.time_ns == next + 2 * us);
    CHECK(world.sample.number == 0);
    CHECK(world.sample.flags == 0);
}

TEST_CASE("spi_imu: a grid that begins while a part is set up goes on from the first point ahead") {
    // Set-up ends exactly when a reading would be armed, or a moment sooner or later.
    for (const Nanoseconds off : {-1, 0, 1}) {
        SpiBench bench(0);
        while (bench.now < 302 * ms || bench.bus.armed) bench.set_up_once();
        bench.step(bench.imu.next_wake(0));
        bench.bus.run(bench.now);
        bench.step(500 * ms + off);
        REQUIRE(bench.is_running());
        const Nanoseconds first = off > 0 ? 501'500 * us : 500'500 * us;
        CHECK(bench.imu.grid().next() == (off == 0 ? first + ms : first));
        CHECK(bench.bus.armed == (off == 0));
        if (off == 0) CHECK(bench.bus.job.after == first);
    }
}

TEST_CASE("spi_imu: a grid goes on at once, however long a part did not answer") {
    constexpr Nanoseconds month = 30 * 86'400 * second;
    SpiBench bench(0);
    while (bench.now < 302 * ms || bench.bus.armed) bench.set_up_once();
    bench.step(bench.imu.next_wake(0));
    bench.bus.run(bench.now);
    bench.step(month);
    REQUIRE(bench.is_running());
    CHECK(bench.bus.job.after == month + 500 * us);
}

TEST_CASE("spi_imu: grid points that have passed are skipped together, and missing") {
    struct Case {
        Nanoseconds late;  ///< after the point that was due
        std::uint32_t missed;
        bool armed;
    };
    for (const Case& made : {Case{0, 0, true}, Case{1, 1, false}, Case{500 * us - 1, 1, false},
                             Case{500 * us, 1, true}, Case{ms - 1, 1, true}, Case{ms, 2, false},
                             Case{1'000 * ms + 700 * us, 1'001, true}}) {
        RunningSpi world(0);
        const Nanoseconds due = world.imu.grid().next();
        world.step(due + made.late);
        CHECK(world.bus.armed == made.armed);
        const Nanoseconds next = due + made.missed * ms;
        CHECK(world.imu.grid().next() == (made.armed ? next + ms : next));
        if (!made.armed) world.step(next - 500 * us);
        CHECK(world.bus.job.after == next);
        world.bus.run(next);
        REQUIRE(world.step(next + 30 * us));
        CHECK(world.sample.number == made.missed);
        CHECK(((world.sample.flags & wire::imu_overrun) != 0) == (made.missed > 0));
    }
}

TEST_CASE("spi_imu: a grid point that finds the bus at work is missing, and one that is refused") {
    for (const bool busy : {true, false}) {
        RunningSpi world(0);
        const Nanoseconds due = world.imu.grid().next();
        world.bus.accepts = busy;
        world.step(due - 500 * us);
        world.bus.accepts = true;
        CHECK(world.bus.armed == busy);
        world.step(due + 500 * us);
        if (busy) {
            world.bus.run(due);
            REQUIRE(world.step(due + 600 * us));
            CHECK(world.sample.number == 1);
            CHECK(world.sample.time_ns == due);
            world.step(due + 1'500 * us);
            world.bus.run(due + 2 * ms);
            REQUIRE(world.step(due + 2'100 * us));
            CHECK(world.sample.number == 2);
        } else {
            CHECK(world.bus.job.after == due + ms);
            world.bus.run(due + ms);
            REQUIRE(world.step(due + ms + 30 * us));
            CHECK(world.sample.number == 1);
            CHECK(world.sample.flags == wire::imu_overrun);
        }
    }
}

TEST_CASE("spi_imu: a reading at a grid point must end in time") {
    RunningSpi world(0, 10'000);
    const Nanoseconds due = world.imu.grid().next();
    CHECK(due % (100 * ms) == 500 * us);
    world.step(due - 500 * us);
    CHECK(world.imu.next_wake(0) == due + 25 * ms);
    world.step(due + 25 * ms - 1);
    CHECK(world.reports.events.size() == 1);
    world.step(due + 25 * ms);
    CHECK(world.reports.events.back() ==
          SpiEvent{wire::BoardEventKind::imu_silent, due + 25 * ms, 0, while_running});
    CHECK(world.imu.next_wake(0) == world.now + second);
    // At least one sample is missing when it is back.
    while (world.reports.count(wire::BoardEventKind::imu_ready) < 2) world.set_up_once();
    const Nanoseconds next = world.imu.grid().next();
    world.step(next - 500 * us);
    world.bus.run(next);
    REQUIRE(world.step(next + 30 * us));
    CHECK(world.sample.number == 1);
    CHECK(world.sample.flags == wire::imu_overrun);
}

TEST_CASE("spi_imu: another configuration ends what was going on") {
    for (const bool collected : {false, true}) {
        RunningSpi world(wire::imu_data_ready | wire::imu_i2c);
        world.now += ms;
        world.edge(world.now);
        if (collected) {
            world.bus.run(world.now);
            world.imu.collect(world.now + 30 * us);
        }
        world.imu.configure({wire::ImuKind::none, 0, 0, 0, 0}, world.now);
        CHECK_FALSE(world.bus.armed);
        CHECK(world.imu.next_wake(0) == never);
        CHECK_FALSE(world.step(world.now + second));
        CHECK_FALSE(world.bus.armed);
        world.imu.configure({wire::ImuKind::icm42688p, 0, wire::imu_data_ready, 0, 1'000'000},
                            world.now);
        CHECK(world.imu.next_wake(0) == world.now);
        CHECK_FALSE(world.step());
        CHECK(world.bus.armed);
        CHECK(world.reports.events.size() == 1);
        // On another bus now, and set up in as many steps as the first time.
        for (int i = 0; i < 10; ++i) {
            CHECK(world.bus.job.transfers[0].bus == ImuTransfer::Bus::spi);
            world.set_up_once();
        }
        CHECK(world.reports.count(wire::BoardEventKind::imu_ready) == 2);
        CHECK(world.bus.job.transfers[0].bus == ImuTransfer::Bus::spi);
        CHECK(world.bus.job.transfers[1].bus == ImuTransfer::Bus::spi);
    }
}

TEST_CASE("spi_imu: a part that paces the samples does so at a rate of its own") {
    using Kind = wire::ImuKind;
    constexpr std::uint8_t paced = wire::imu_data_ready;
    CHECK(SpiImu::true_rate({Kind::icm42688p, 0, paced, 0, 700'000}) == 1'000'000);
    CHECK(SpiImu::true_rate({Kind::icm42688p, 0, 0, 0, 700'000}) == 700'000);
    CHECK(SpiImu::true_rate({Kind::none, 0, paced, 0, 700'000}) == 700'000);
    CHECK(SpiImu::true_rate({Kind::vn100, 0, paced, 0, 700'000}) == 700'000);
}
