// SPDX-License-Identifier: BSD-3-Clause
#include "camera_group.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// Nobody is there: the group is asked before anything is started.
class NoBoard final : public BoardListener {
 public:
    void board_restarted() override {}
    void board_synchronised() override {}
    void board_connected() override {}
    void cameras_changed(std::uint8_t /*outputs*/, std::uint8_t /*other_rate*/) override {}
    void board_lost() override {}
    void exposure(const wire::Exposure& /*record*/, HostTime /*received*/) override {}
    bool imu_sample(const wire::ImuSample& /*sample*/, HostTime /*received*/) override {
        return true;
    }
    void exchange_doubted(const Implausibility& /*doubt*/) override {}
    void board_event(const wire::Event& /*event*/, HostTime /*received*/) override {}
};

struct GroupBench : test::Pipelines {
    GroupBench() {
        add("left", 2, TriggerSource::board);
        add("free", 0, TriggerSource::free_run);
        add("right", 0, TriggerSource::board);
    }

    void add(const char* name, unsigned output, TriggerSource trigger) {
        CameraConfiguration configuration;
        configuration.name = name;
        configuration.output = output;
        configuration.trigger = trigger;
        group.add(configuration);
    }

    ClockRecorder recorder{writer({"clock", ring::StreamKind::clock, 64}), translator};
    NoBoard listener;
    BoardLink link{[]() -> Expected<std::unique_ptr<ByteStream>> { return failure("", ""); },
                   {},
                   10,
                   translator,
                   recorder,
                   listener};
    CameraGroup group{directory.path(), {}, directory.path(), translator, events, link};
};

}  // namespace

TEST_CASE("camera_group: an output's events are those of the camera that it triggers") {
    GroupBench bench;
    JournalEntry entry;
    entry.source = 0;
    bench.group.name_source(entry);
    CHECK(entry.source_name == "right");
    CHECK(entry.source == 2);
    JournalEntry nobody;
    nobody.source = 3;
    nobody.source_name = "board";
    bench.group.name_source(nobody);
    CHECK(nobody.source_name == "board");
    CHECK(nobody.source == 0);
}

TEST_CASE("camera_group: a record reaches the camera of its output, and comes back stamped") {
    GroupBench bench;
    const HostTime at{100'000'000'000};
    bench.synchronise(at);
    wire::Exposure record{};
    record.camera = 2;
    record.trigger = 1;
    record.flags = wire::exposure_measured;
    record.trigger_ns = record.start_ns = GroupBench::to_board(at).ns;
    record.end_ns = record.start_ns + 2'000'000;
    const auto stamp = bench.group.add(record, at + milliseconds(3));
    REQUIRE(stamp);
    CHECK(absolute(stamp->host - (at + milliseconds(1))) <= microseconds(1));
    record.camera = 1;
    CHECK_FALSE(bench.group.add(record, at + milliseconds(3)));
    const auto cameras = bench.group.status();
    CHECK(cameras[0].pipeline.triggers == 1);
    CHECK(cameras[2].pipeline.triggers == 0);
}

TEST_CASE("camera_group: streams are named after the cameras") {
    GroupBench bench;
    std::vector<std::string> names;
    for (const StreamStatus& stream : bench.group.streams()) names.push_back(stream.name);
    CHECK(names ==
          std::vector<std::string>{"left", "left-evidence", "free", "right", "right-evidence"});
    CHECK(bench.group.any_needs_board());
}
