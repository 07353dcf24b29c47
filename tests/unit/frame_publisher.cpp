// SPDX-License-Identifier: BSD-3-Clause
#include "publish/frame_publisher.hpp"
#include "../support/look.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

struct PublisherBench : test::Pipelines {
    PublisherBench() {
        CameraConfiguration configuration;
        configuration.name = "cam0";
        configuration.slots = 9;
        frames.emplace(configuration);
        make_room(4096);
    }

    void make_room(std::uint64_t payload_size) {
        auto ring = frames->make_ring(directory.path(), payload_size);
        REQUIRE(ring);
        if (*ring) frames->use(std::move(**ring));
    }

    pairing::Arrival arrival() {
        pairing::Arrival made;
        made.slot = frames->acquire().value();
        made.block_id = 12;
        made.arrived = HostTime{100'030'000'000};
        made.width = 64;
        made.height = 48;
        made.size = 3072;
        made.sensor = {6.5F, 41};
        return made;
    }

    std::optional<FramePublisher> frames;
};

pairing::Exposure stamped_exposure(StampKind kind) {
    pairing::Exposure made;
    made.trigger = 5;
    made.tick = (std::uint64_t{1} << 32U) + 6;
    made.start = {99'000'000'000};
    made.end = made.start + milliseconds(4);
    made.kind = kind;
    made.delay = microseconds(27);
    made.delay_sigma = {kind == StampKind::measured_middle ? 4'000 : 0};
    return made;
}

const clock::Stamp middle_stamp{
    {200'002'000'000}, {100'002'000'000}, 3'000, 8, clock::ClockState::locked};

}  // namespace

TEST_CASE("frame_publisher: a proved frame has its exposure's middle and both sigmas") {
    PublisherBench bench;
    auto reader = bench.reader("cam0");
    bench.frames->publish_proved(bench.arrival(), stamped_exposure(StampKind::measured_middle),
                                 middle_stamp);
    bench.frames->publish_proved(bench.arrival(), stamped_exposure(StampKind::trigger_edge),
                                 middle_stamp);
    const auto first = test::look(reader.next());
    const auto measured = unpack<FrameMetadata>(first.metadata);
    CHECK(first.time.output() == middle_stamp.output);
    CHECK(measured.board_time.ns == 99'002'000'000);
    CHECK(measured.host_time == middle_stamp.host);
    CHECK(measured.exposure == milliseconds(4));
    CHECK(measured.sigma_ns == 5'000);
    CHECK(measured.delay_ns == 27'000);
    CHECK(measured.epoch == 8);
    CHECK(measured.trigger == 5);
    CHECK(measured.tick() == (std::uint64_t{1} << 32U) + 6);
    CHECK(measured.block_id == 12);
    CHECK(unpack_sensor_state(first.payload.attributes()).gain == 6.5F);
    CHECK(unpack_sensor_state(first.payload.attributes()).temperature_c == 41);
    const auto by_edge = unpack<FrameMetadata>(test::look(reader.next()).metadata);
    CHECK(by_edge.stamp_kind() == StampKind::trigger_edge);
    CHECK(by_edge.exposure.ns == 0);
    CHECK(by_edge.sigma_ns > 2'000'000);
}

TEST_CASE("frame_publisher: what is not proved has no sigma, and says so") {
    PublisherBench bench;
    auto reader = bench.reader("cam0");
    bench.frames->publish_guessed(bench.arrival(), stamped_exposure(StampKind::measured_middle),
                                  middle_stamp);
    bench.frames->publish_arrived(bench.arrival(), middle_stamp, true);
    bench.frames->publish_arrived(bench.arrival(), middle_stamp, false);
    for (const std::uint32_t suspect : {flag_suspect, flag_suspect, ItemFlag{}}) {
        const auto frame = unpack<FrameMetadata>(test::look(reader.next()).metadata);
        CHECK(frame.sigma_ns == sigma_unknown);
        CHECK((frame.flags & flag_suspect) == suspect);
    }
}

TEST_CASE("frame_publisher: larger frames get a new ring, smaller ones do not") {
    PublisherBench bench;
    auto reader = bench.reader("cam0");
    bench.make_room(100);
    bench.frames->publish_arrived(bench.arrival(), middle_stamp, false);
    CHECK(test::look(reader.next()).found == test::Found::item);
    bench.make_room(5000);
    CHECK(test::look(reader.next()).found == test::Found::restarted);
    CHECK(bench.frames->items() == 0);
}
