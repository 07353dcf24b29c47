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

TEST_CASE(
    "imu_pipeline: samples are stamped with the time of the motion, not of the filter's end") {
    test::Pipelines bench;
    ImuConfiguration configuration;
    configuration.model = imu::find_model("adis16448b");
    configuration.filter = 4;
    const auto override_us = GENERATE(as<std::optional<double>>(), std::nullopt, 5000.0, 0.0);
    configuration.filter_delay_us = override_us;
    const Duration delay = override_us ? from_us(*override_us) : microseconds(18311);
    ImuPipeline pipeline(configuration, bench.writer({"imu0", ring::StreamKind::imu, 64}),
                         bench.translator);
    auto reader = bench.reader("imu0");
    const HostTime begin{50'000'000'000};
    bench.exchange(begin);
    pipeline.add(sample(1, test::Pipelines::to_board(begin + milliseconds(40))));
    const ring::Item item = reader.next();
    const auto metadata = unpack<ImuMetadata>(item.metadata);
    CHECK(absolute(metadata.host_time - (begin + milliseconds(40) - delay)) < microseconds(1));
    CHECK(item.time.ns == metadata.host_time.ns);
    // The board's own stamp stays as it is, beside what was taken off.
    CHECK(metadata.board_time == test::Pipelines::to_board(begin + milliseconds(40)));
    CHECK(absolute(metadata.filter_delay - delay) < microseconds(1));
    CHECK((metadata.sigma_ns >= 100'000) == !override_us);
    CHECK(pipeline.report().filter.source ==
          (override_us ? imu::DelaySource::configuration : imu::DelaySource::model));
}
