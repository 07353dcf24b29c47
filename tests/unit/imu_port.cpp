// SPDX-License-Identifier: BSD-3-Clause
#include "imu/imu_port.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "recorded_reports.hpp"

using namespace versavis;
using namespace versavis::firmware;

namespace {

using Reports = test::RecordedReports;

struct Port final : ImuPort {
    using ImuPort::count_error;
    using ImuPort::finish;
    using ImuPort::ImuPort;
    using ImuPort::max_failures;
    using ImuPort::miss;
    using ImuPort::report_event;
    using ImuPort::report_failure;
    using ImuPort::retry_interval;
};

/// A port, and samples of which each is like no other.
struct PortWorld {
    wire::ImuSample sample(unsigned flags = 0) {
        wire::ImuSample sample{};
        sample.flags = static_cast<std::uint16_t>(flags);
        sample.gyro[0] = ++word;
        return sample;
    }
    /// The next number and flags.
    std::pair<unsigned, unsigned> next(unsigned flags = 0) {
        wire::ImuSample next = sample(flags);
        CHECK(port.finish(next));
        CHECK(next.imu == 1);
        return {next.number, next.flags};
    }

    std::int32_t word = 0;
    Reports reports;
    Port port{1, reports};
};

using NumberAndFlags = std::pair<unsigned, unsigned>;

}  // namespace

TEST_CASE(
    "imu_port: numbers count from zero, without those that were missed, which is reported once") {
    PortWorld world;
    CHECK(world.next() == NumberAndFlags{0, 0});
    CHECK(world.next(wire::imu_stamped) == NumberAndFlags{1, wire::imu_stamped});
    world.port.miss();
    CHECK(world.next() == NumberAndFlags{3, wire::imu_overrun});
    CHECK(world.next() == NumberAndFlags{4, 0});
    world.port.miss(7);
    world.port.miss(0);
    CHECK(world.next() == NumberAndFlags{12, wire::imu_overrun});
    world.port.miss(0);
    CHECK(world.next() == NumberAndFlags{13, 0});
    world.port.miss(1);
    CHECK(world.next() == NumberAndFlags{15, wire::imu_overrun});
    CHECK(world.port.errors() == 0);
    CHECK(world.port.restarts() == 0);
}

TEST_CASE("imu_port: a sample is repeated if gyro and accelerometer are as in the one before") {
    PortWorld world;
    wire::ImuSample sample{};
    const auto repeated = [&world, &sample] {
        wire::ImuSample next = sample;
        CHECK(world.port.finish(next));
        return (next.flags & wire::imu_repeated) != 0;
    };
    sample.accel[2] = 1;
    CHECK_FALSE(repeated());
    CHECK(repeated());
    CHECK(repeated());
    for (std::size_t axis = 0; axis < 3; ++axis) {
        for (std::int32_t* word : {&sample.gyro[axis], &sample.accel[axis]}) {
            *word += 5;
            CHECK_FALSE(repeated());
            CHECK(repeated());
        }
        sample.magnetic[axis] += 1;
        CHECK(repeated());
    }
    sample.temperature = 3;
    sample.pressure = 4;
    sample.time_ns = 5;
    CHECK(repeated());
    sample.gyro[0] = 0;  // and one axis alone may be as before
    CHECK_FALSE(repeated());
    CHECK(world.port.errors() == 0);
}

TEST_CASE("imu_port: what a part says is repeated stays so") {
    PortWorld world;
    CHECK(world.next(wire::imu_repeated) == NumberAndFlags{0, wire::imu_repeated});
    CHECK(world.next() == NumberAndFlags{1, 0});
}

TEST_CASE("imu_port: failed samples are counted, and twenty in a row are too many") {
    PortWorld world;
    wire::ImuSample sample{};
    for (int round = 0; round < 2; ++round) {
        for (int i = 1; i < 20; ++i) world.next(wire::imu_check_failed);
        world.next();  // one good sample between
    }
    CHECK(world.port.errors() == 38);
    // Those that give no sample count alike.
    for (int i = 1; i < 20; ++i) {
        if (i % 2 == 0)
            world.next(wire::imu_check_failed);
        else
            CHECK(world.port.count_error());
    }
    SECTION("the last gives a sample") {
        sample = world.sample(wire::imu_check_failed);
        CHECK_FALSE(world.port.finish(sample));
        CHECK((sample.flags & wire::imu_check_failed) != 0);
    }
    SECTION("the last gives none") { CHECK_FALSE(world.port.count_error()); }
    CHECK(world.port.errors() == 58);
    CHECK(world.port.restarts() == 0);
    // Once it is reported, they are counted anew.
    world.port.report_failure(wire::BoardEventKind::imu_failed, 5, 0);
    CHECK(world.port.restarts() == 1);
    for (int i = 1; i < 20; ++i) CHECK(world.port.count_error());
    CHECK_FALSE(world.port.count_error());
    CHECK(world.port.errors() == 78);
}

TEST_CASE("imu_port: a part's own diagnosis is an error of each sample, and no failure") {
    PortWorld world;
    for (int i = 0; i < 30; ++i) world.next(wire::imu_self_test_failed);
    CHECK(world.port.errors() == 30);
    world.next(wire::imu_self_test_failed | wire::imu_check_failed);
    CHECK(world.port.errors() == 31);
}

TEST_CASE("imu_port: events name the port, and after a failure at least one sample is missing") {
    PortWorld world;
    world.port.report_event(wire::BoardEventKind::imu_ready, 7, 100);
    CHECK(world.reports.events ==
          std::vector<test::ReportedEvent>{{wire::BoardEventKind::imu_ready, 1, 7, 100, 0}});
    CHECK(world.next() == NumberAndFlags{0, 0});
    world.port.report_failure(wire::BoardEventKind::imu_silent, 8, 9);
    world.port.report_failure(wire::BoardEventKind::imu_failed, 10, 11, 12);
    CHECK(world.port.restarts() == 2);
    REQUIRE(world.reports.events.size() == 3);
    CHECK(world.reports.events[1] ==
          test::ReportedEvent{wire::BoardEventKind::imu_silent, 1, 8, 9, 0});
    CHECK(world.reports.events[2] ==
          test::ReportedEvent{wire::BoardEventKind::imu_failed, 1, 10, 11, 12});
    CHECK(world.next() == NumberAndFlags{3, wire::imu_overrun});
}
