// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

std::size_t repeated(const std::vector<wire::ImuSample>& samples, std::size_t from) {
    return static_cast<std::size_t>(
        std::count_if(samples.begin() + static_cast<std::ptrdiff_t>(from), samples.end(),
                      [](const auto& sample) { return (sample.flags & wire::imu_repeated) != 0; }));
}

}  // namespace

TEST_CASE("045-imu-repeated: the samples of a part that takes no new data say so") {
    const wire::ImuKind kind =
        GENERATE(from_range(std::begin(spi_imu_kinds), std::end(spi_imu_kinds)));
    const bool data_ready = GENERATE(true, false);
    INFO("kind " << int(kind));
    Nanoseconds frozen_at = firmware::never;
    const devices::World motion = [&](Nanoseconds at) {
        return trembling(std::min(at, frozen_at));
    };
    Scenario world;
    world.add_imu(make_imu(kind, motion), kind, 200, data_ready);
    REQUIRE(world.begin());
    world.run(2 * second);
    frozen_at = world.now();
    world.run(20 * ms);
    const std::size_t before = world.inbox().samples[0].size();
    world.run(second);
    const std::size_t frozen = world.inbox().samples[0].size();
    CHECK(frozen > before + 190);
    CHECK(repeated(world.inbox().samples[0], before) == frozen - before);
    CHECK(world.inbox().healths.back().imu_errors[0] == 0);  // it is no failure
    frozen_at = firmware::never;
    world.run(20 * ms);
    const std::size_t after = world.inbox().samples[0].size();
    world.run(second);
    CHECK(repeated(world.inbox().samples[0], after) == 0);
}

TEST_CASE("045-imu-repeated-part: so do those of a part that signals new data without taking it") {
    Scenario world;
    auto device = std::make_unique<devices::Icm42688pDevice>(&trembling);
    devices::Icm42688pDevice& part = *device;
    world.add_imu(std::move(device), wire::ImuKind::icm42688p, 1000, true);
    REQUIRE(world.begin());
    world.run(2 * second);
    CHECK(repeated(world.inbox().samples[0], 1) == 0);
    part.freeze(world.now());
    world.run(20 * ms);
    const std::size_t before = world.inbox().samples[0].size();
    world.run(second);
    const std::size_t frozen = world.inbox().samples[0].size();
    CHECK(frozen > before + 950);
    CHECK(repeated(world.inbox().samples[0], before) == frozen - before);
    part.freeze(firmware::never);
    world.run(20 * ms);
    const std::size_t after = world.inbox().samples[0].size();
    world.run(second);
    CHECK(repeated(world.inbox().samples[0], after) == 0);
}

TEST_CASE("045-imu-repeated-vn100: so do those of a VN-100") {
    Scenario world;
    devices::Vn100Device& part = world.add_vn100(200, GENERATE(true, false));
    REQUIRE(world.begin());
    world.run(2 * second);
    CHECK(repeated(world.inbox().samples[1], 0) == 0);
    part.freeze(world.now());
    world.run(20 * ms);
    const std::size_t before = world.inbox().samples[1].size();
    world.run(second);
    const std::size_t frozen = world.inbox().samples[1].size();
    CHECK(frozen > before + 190);
    CHECK(repeated(world.inbox().samples[1], before) == frozen - before);
    part.freeze(firmware::never);
    world.run(20 * ms);
    const std::size_t after = world.inbox().samples[1].size();
    world.run(second);
    CHECK(repeated(world.inbox().samples[1], after) == 0);
}
