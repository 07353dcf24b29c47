// SPDX-License-Identifier: BSD-3-Clause
#include "imu/spi_imu.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

using namespace versavis;
using namespace versavis::firmware;

namespace {

constexpr Nanoseconds ms = 1'000'000;

struct Reports final : ChannelReports {
    void exposure(const wire::Exposure& /*record*/) override {}
    void event(wire::EventKind kind, std::uint8_t /*source*/, Nanoseconds /*at*/,
               std::int64_t /*value*/, std::uint16_t /*detail*/) override {
        events.push_back(kind);
    }
    void exposure_planned(std::uint8_t /*camera*/, Nanoseconds /*start*/,
                          Nanoseconds /*duration*/) override {}

    std::size_t count(wire::EventKind kind) const {
        return static_cast<std::size_t>(std::count(events.begin(), events.end(), kind));
    }
    std::vector<wire::EventKind> events;
};

/// A bus with an ICM-42688-P that answers what its set-up expects; the test says when.
struct Bus final : ImuBus {
    bool arm(const ImuJob& wanted) override {
        job = wanted;
        taken = 0;
        armed = true;
        return true;
    }
    bool take_reply(ImuReply& reply) override {
        if (!armed || !done) return false;
        reply = answers[taken++];
        if (taken == job.count) armed = done = false;
        return true;
    }
    void disarm() override { armed = false; }

    /// The job starts at `at`; its transfers take 10 us each.
    void run(Nanoseconds at, bool refused = false) {
        REQUIRE(armed);
        for (unsigned i = 0; i < job.count; ++i, at += 10'000) {
            answers[i] = {};
            answers[i].started = at;
            answers[i].ended = at + 10'000;
            answers[i].refused = refused;
            const std::uint8_t address = job.transfers[i].bytes[0] & 0x7FU;
            if (address == 0x75) answers[i].bytes[1] = 0x47;
            if (address == 0x4E) answers[i].bytes[1] = 0x0F;
            if (address == 0x1D) {
                answers[i].bytes[9] = ++counter;
                answers[i].bytes[1 + 16] = fresh ? 0x08 : 0x00;
            }
        }
        done = true;
    }

    ImuJob job;
    ImuReply answers[max_transfers];
    unsigned taken = 0;
    std::uint8_t counter = 0;
    bool fresh = true;
    bool armed = false;
    bool done = false;
};

/// At 1 kHz, set up and waiting for its first edge.
struct Running {
    explicit Running(unsigned options = wire::imu_data_ready) {
        imu.configure(
            {wire::ImuKind::icm42688p, 0, static_cast<std::uint8_t>(options), 0, 1'000'000}, 0);
        for (; reports.count(wire::EventKind::imu_ready) == 0; now += ms) {
            REQUIRE(now < 2'000 * ms);
            step();
            if (bus.armed && bus.job.input == not_routed) bus.run(now);
        }
        step();
        REQUIRE(bus.armed);
        REQUIRE(bus.job.input == input_imu_ready);
    }

    /// All edges before now are known. True: there was a sample.
    bool step() {
        imu.collect(now);
        return imu.poll(now, now, sample);
    }
    void edge(Nanoseconds at) { imu.ready_edge(at, now); }
    /// An edge, and its reading `late` after it.
    bool read(Nanoseconds late = 1'000) {
        now += ms;
        edge(now);
        const Nanoseconds at = now;
        bus.run(at + late);
        now = at + late + 50'000;
        const bool taken = step();
        now = at;
        return taken;
    }

    Reports reports;
    Bus bus;
    SpiImu imu{0, bus, reports};
    Nanoseconds now = 0;
    wire::ImuSample sample{};
};

}  // namespace

TEST_CASE("spi_imu: neither the newest edge nor its echoes start a reading") {
    Running world;
    REQUIRE(world.read());
    CHECK(world.sample.time_ns == world.now);
    CHECK(world.bus.job.after == world.now + 100'000 - 1);  // the most that an echo is late
    // A late echo is not one of the edges, and nothing starts at it either.
    world.edge(world.now + 99'000);
    CHECK(world.imu.take_glitches() == 1);
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_overrun) == 0);
}

TEST_CASE("spi_imu: a second reading of the same data gives no sample") {
    Running world;
    REQUIRE(world.read());
    const std::uint32_t number = world.sample.number;
    world.bus.run(world.now + 200'000);
    world.now += 300'000;
    CHECK_FALSE(world.step());
    world.now -= 300'000;
    REQUIRE(world.read());
    CHECK(world.sample.number == number + 1);
}

TEST_CASE("spi_imu: a reading whose edge is not known gives no sample, and the next one says so") {
    Running world;
    REQUIRE(world.read());
    const std::uint32_t number = world.sample.number;
    const Nanoseconds before = world.sample.time_ns;
    world.now += ms;
    world.edge(world.now);  // it is known, but not that of the reading
    world.now += 2 * ms;    // two edges came and were lost; the reading is that of the last
    world.imu.edges_lost();
    world.bus.run(world.now + 1'000);
    world.now += 50'000;
    CHECK_FALSE(world.step());
    world.now -= 50'000;
    REQUIRE(world.read());
    CHECK(world.sample.time_ns == before + 4 * ms);
    CHECK(world.sample.number == number + 4);
    CHECK((world.sample.flags & wire::imu_overrun) != 0);
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_overrun) == 0);
}

TEST_CASE("spi_imu: new data within a reading spoils it") {
    Running world;
    REQUIRE(world.read());
    world.now += ms;
    world.edge(world.now);
    world.bus.run(world.now + 995'000);
    world.now += ms;
    world.edge(world.now);
    world.now += 50'000;
    CHECK_FALSE(world.step());
    CHECK(world.imu.errors() == 1);
    world.now -= 50'000;
    REQUIRE(world.read());
    CHECK((world.sample.flags & wire::imu_overrun) != 0);
}

TEST_CASE("spi_imu: readings that nobody acknowledges give no samples, and twenty restart it") {
    Running world(wire::imu_data_ready | wire::imu_i2c | wire::imu_i2c_second);
    CHECK(world.bus.job.transfers[0].bus == ImuTransfer::Bus::i2c_read);
    CHECK(world.bus.job.transfers[0].chip == 0x69);
    CHECK(world.bus.job.transfers[0].bytes[0] == 0x1D);
    CHECK(world.bus.job.transfers[0].clock_hz == 400'000);
    for (int i = 0; i < 20; ++i) {
        CHECK(world.reports.count(wire::EventKind::imu_silent) == 0);
        world.now += ms;
        world.edge(world.now);
        world.bus.run(world.now, true);
        world.now += 50'000;
        CHECK_FALSE(world.step());
        world.now -= 50'000;
    }
    CHECK(world.reports.count(wire::EventKind::imu_silent) == 1);
    CHECK(world.imu.errors() == 20);
}

TEST_CASE("spi_imu: a sample is repeated when the part or its words say so") {
    Running world;
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
