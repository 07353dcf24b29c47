// SPDX-License-Identifier: BSD-3-Clause
#include "exposure_tracker.hpp"

#include <catch2/catch.hpp>
#include <vector>

using namespace versavis;
using namespace versavis::firmware;

namespace {

constexpr Nanoseconds ms = 1'000'000;

struct Reports final : ChannelReports {
    std::vector<wire::Exposure> exposures;
    std::vector<wire::EventKind> events;
    void exposure(const wire::Exposure& record) override { exposures.push_back(record); }
    void event(wire::EventKind kind, std::uint8_t /*source*/, Nanoseconds /*at*/,
               std::int64_t /*value*/, std::uint16_t /*detail*/) override {
        events.push_back(kind);
    }
    void exposure_planned(std::uint8_t /*camera*/, Nanoseconds /*start*/,
                          Nanoseconds /*duration*/) override {}
};

/// A tracker that waits for triggers at 98, 148, ... ms, patient with exposures of up to a second.
struct Bench {
    explicit Bench(std::uint32_t flags = 0, unsigned triggers = 1) {
        wire::CameraConfiguration camera{};
        camera.flags = wire::camera_enabled | flags;
        camera.rate_uhz = 20'000'000;
        camera.max_exposure_ns = 1000 * ms;
        tracker.configure(camera, 50 * ms);
        for (unsigned i = 0; i < triggers; ++i) {
            wire::Exposure record{};
            record.trigger = i + 1;
            record.trigger_ns = (98 + 50 * i) * ms;
            record.start_ns = record.end_ns = wire::no_time;
            tracker.add(record, 4 * ms);
        }
    }

    Reports reports;
    ExposureTracker tracker{0, reports};
};

}  // namespace

TEST_CASE("exposure_tracker: after lost edges no end is taken for that of a start seen before") {
    Bench bench;
    bench.tracker.edge(98 * ms, true);
    bench.tracker.edges_lost();
    bench.tracker.edge(152 * ms, false);
    REQUIRE(bench.reports.exposures.size() == 1);
    CHECK(bench.reports.exposures[0].flags == wire::exposure_no_end);
    CHECK(bench.reports.exposures[0].end_ns == wire::no_time);
    CHECK(bench.reports.events == std::vector<wire::EventKind>{wire::EventKind::stray_edge});
}

TEST_CASE("exposure_tracker: a new start ends the wait for an end that was missed") {
    Bench bench(0, 2);
    bench.tracker.edge(98 * ms, true);
    bench.tracker.edge(148 * ms, true);
    CHECK(bench.tracker.edge(152 * ms, false).duration == 4 * ms);
    REQUIRE(bench.reports.exposures.size() == 2);
    CHECK(bench.reports.exposures[0].flags == wire::exposure_no_end);
    CHECK(bench.reports.exposures[1].flags == wire::exposure_measured);
}

TEST_CASE("exposure_tracker: without an exposure line the record follows from the trigger") {
    Bench bench(wire::camera_no_strobe);
    CHECK(bench.tracker.next_deadline() == 102 * ms);
    bench.tracker.expire(102 * ms);
    REQUIRE(bench.reports.exposures.size() == 1);
    CHECK(bench.reports.exposures[0].flags == wire::exposure_predicted);
    CHECK(bench.reports.exposures[0].end_ns - bench.reports.exposures[0].start_ns == 4 * ms);
}

TEST_CASE("exposure_tracker: a word that left late corrects the trigger's time, and says so") {
    Bench bench;
    bench.tracker.moved(98 * ms, 99 * ms, true);
    bench.tracker.edge(99 * ms, true);
    bench.tracker.edge(103 * ms, false);
    REQUIRE(bench.reports.exposures.size() == 1);
    CHECK(bench.reports.exposures[0].trigger_ns == 99 * ms);
    CHECK(bench.reports.exposures[0].flags == (wire::exposure_measured | wire::exposure_late));
}

TEST_CASE(
    "exposure_tracker: an exposure that is overdue may last for any time, one that was given up is "
    "over") {
    Bench bench;
    CHECK(bench.tracker.busy_until(90 * ms) == 102 * ms);
    bench.tracker.edge(98 * ms, true);
    CHECK(bench.tracker.busy_until(101 * ms) == 102 * ms);
    CHECK(bench.tracker.busy_until(103 * ms) > 100'000 * ms);
    bench.tracker.expire(1098 * ms);
    CHECK(bench.reports.exposures[0].flags == (wire::exposure_no_end | wire::exposure_overlong));
    CHECK(bench.tracker.busy_until(1099 * ms) == 1098 * ms);
}
