// SPDX-License-Identifier: BSD-3-Clause
#include "stream/imu_pipeline.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

wire::ImuSample sample(std::uint32_t number, BoardTime at, std::uint16_t flags = 0) {
    wire::ImuSample sample{};
    sample.kind = wire::ImuKind::adis16448b;
    sample.number = number;
    sample.time_ns = at.ns;
    sample.flags = flags;
    return sample;
}

}  // namespace

TEST_CASE(
    "imu_pipeline: nothing before the clock is known, numbers go on over 32 bits, losses are "
    "counted") {
    test::Pipelines bench;
    ImuConfiguration configuration;
    configuration.model = imu::find_model("adis16448b");
    ImuPipeline pipeline(configuration, bench.writer({"imu0", ring::StreamKind::imu, 64}),
                         bench.translator);
    auto reader = bench.reader("imu0");
    const HostTime begin{50'000'000'000};
    const auto at = [&](int i) { return test::Pipelines::to_board(begin + milliseconds(5 * i)); };
    pipeline.add(sample(0xFFFFFFFD, at(0)));
    CHECK(pipeline.report().no_clock == 1);
    bench.exchange(begin);
    pipeline.add(sample(0xFFFFFFFE, at(1)));
    pipeline.add(sample(1, at(4)));
    pipeline.add(sample(2, at(5), wire::imu_check_failed));
    const auto first = unpack<ImuMetadata>(reader.next().metadata);
    const auto second = unpack<ImuMetadata>(reader.next().metadata);
    const auto third = unpack<ImuMetadata>(reader.next().metadata);
    CHECK(first.number == 0xFFFFFFFEU);
    CHECK(second.number == 0x100000001U);
    CHECK((third.flags & flag_sensor_error) != 0);
    CHECK(pipeline.report().lost == 2);
    CHECK(pipeline.report().faulty == 1);
    CHECK(pipeline.report().published == 3);
    pipeline.board_restarted();
    pipeline.add(sample(0, at(6)));
    CHECK(unpack<ImuMetadata>(reader.next().metadata).number == 0);
    CHECK(pipeline.report().lost == 2);
}

TEST_CASE("imu_pipeline: a failure is told once, then rarely, and anew when it has changed") {
    test::Pipelines bench;
    ImuConfiguration configuration;
    configuration.model = imu::find_model("adis16448b");
    ImuPipeline pipeline(configuration, bench.writer({"imu0", ring::StreamKind::imu, 16}),
                         bench.translator);
    wire::Event event{};
    HostTime now{100'000'000'000};
    int told = 0;
    const auto tell = [&](wire::EventKind kind, std::int64_t value) {
        event.kind = kind;
        event.value = value;
        now = now + seconds(1);
        if (pipeline.tell(event, now)) ++told;
    };
    for (int i = 0; i < 3600; ++i) tell(wire::EventKind::imu_failed, 120);
    CHECK(told == 6);
    CHECK_FALSE(pipeline.report().working);
    CHECK(pipeline.report().failure.times == 3600);
    tell(wire::EventKind::imu_failed, 0);
    CHECK(told == 7);
    tell(wire::EventKind::imu_ready, 0);
    CHECK(told == 8);
    CHECK(pipeline.report().working);
    now = now + seconds(120);
    tell(wire::EventKind::imu_failed, 0);
    CHECK(told == 9);
    for (int i = 0; i < 100; ++i) {  // it comes and goes
        tell(wire::EventKind::imu_ready, 0);
        tell(wire::EventKind::imu_failed, 0);
    }
    CHECK(told <= 11);
}
