// SPDX-License-Identifier: BSD-3-Clause
#include "camera_channel.hpp"

#include <catch2/catch.hpp>
#include <vector>

using namespace versavis;
using namespace versavis::firmware;

namespace {

constexpr Nanoseconds ms = 1'000'000;

struct Hardware final : OutputSchedule {
    std::vector<Nanoseconds> words;
    bool push(Nanoseconds at, std::uint32_t /*levels*/) override {
        words.push_back(at);
        return true;
    }
    Nanoseconds take_lateness() override { return 0; }
};

struct Reports final : ChannelReports {
    std::vector<wire::Exposure> exposures;
    std::vector<wire::EventKind> events;
    void exposure(const wire::Exposure& record) override { exposures.push_back(record); }
    void event(wire::EventKind kind, std::uint8_t /*source*/, Nanoseconds /*at*/,
               std::int64_t /*value*/) override {
        events.push_back(kind);
    }
};

/// A channel at 20 Hz that has sent one trigger; patient with exposures of up to a second.
struct Bench {
    explicit Bench(std::uint32_t flags = 0) {
        channel.configure({wire::camera_enabled | flags, 20'000'000, 0, 100'000, 0, 0, 4 * ms, 1000 * ms}, 0);
        channel.start(100 * ms, 0, false);
        channel.poll(97 * ms);
    }

    Hardware hardware;
    OutputQueue outputs{hardware};
    Reports reports;
    CameraChannel channel{0, outputs, reports};
};

}  // namespace

TEST_CASE("camera_channel: after lost edges no end is taken for that of a start seen before") {
    Bench bench;
    bench.channel.edge(98 * ms, true);
    bench.channel.edges_lost();
    bench.channel.edge(152 * ms, false);
    REQUIRE(bench.reports.exposures.size() == 1);
    CHECK(bench.reports.exposures[0].flags == wire::exposure_no_end);
    CHECK(bench.reports.exposures[0].end_ns == wire::no_time);
    CHECK(bench.reports.events == std::vector<wire::EventKind>{wire::EventKind::stray_edge});
}

TEST_CASE("camera_channel: a new start ends the wait for an end that was missed") {
    Bench bench;
    bench.channel.edge(98 * ms, true);
    bench.channel.poll(101 * ms);
    bench.channel.edge(148 * ms, true);
    bench.channel.edge(152 * ms, false);
    for (const wire::Exposure& record : bench.reports.exposures)
        if ((record.flags & wire::exposure_measured) != 0) CHECK(record.end_ns - record.start_ns <= 5 * ms);
}

TEST_CASE("camera_channel: an input that is not wired is not listened to") {
    Bench bench(wire::camera_no_strobe);
    bench.channel.edge(99 * ms, true);
    bench.channel.edge(100 * ms, false);
    bench.channel.poll(103 * ms);
    REQUIRE(bench.reports.exposures.size() == 1);
    CHECK(bench.reports.exposures[0].flags == wire::exposure_no_strobe);
    CHECK(bench.reports.exposures[0].end_ns - bench.reports.exposures[0].start_ns == 4 * ms);
    CHECK(bench.reports.events.empty());
}
