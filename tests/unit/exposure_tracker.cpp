// SPDX-License-Identifier: BSD-3-Clause
#include "exposure_tracker.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "nanoseconds.hpp"

using namespace versavis;
using namespace versavis::firmware;
using namespace versavis::test;

namespace {

constexpr std::uint16_t measured_flag = wire::exposure_measured;
constexpr std::uint16_t no_start = wire::exposure_no_start;
constexpr std::uint16_t no_end = wire::exposure_no_end;
constexpr std::uint16_t predicted = wire::exposure_predicted;
constexpr std::uint16_t overlong = wire::exposure_overlong;

struct Stray {
    Nanoseconds at;
    std::int64_t level;
    bool operator==(const Stray& other) const { return at == other.at && level == other.level; }
};

struct TrackerReports final : ChannelReports {
    std::vector<wire::Exposure> exposures;
    std::vector<Stray> strays;
    void exposure(const wire::Exposure& record) override { exposures.push_back(record); }
    void event(wire::BoardEventKind kind, std::uint8_t source, Nanoseconds at, std::int64_t value,
               std::uint16_t detail) override {
        CHECK(kind == wire::BoardEventKind::stray_edge);
        CHECK(source == 3);
        CHECK(detail == 0);
        strays.push_back({at, value});
    }
    void exposure_planned(std::uint8_t /*camera*/, Nanoseconds /*start*/,
                          Nanoseconds /*duration*/) override {}

    std::vector<std::uint16_t> flags() const {
        std::vector<std::uint16_t> all;
        for (const wire::Exposure& record : exposures) all.push_back(record.flags);
        return all;
    }
};

using Flags = std::vector<std::uint16_t>;
using Strays = std::vector<Stray>;

/// A tracker that waits for triggers at 100, 150, ... ms, on grid points 11, 12, ..., of exposures
/// of 4 ms, for up to 50 ms, and is patient with exposures of up to a second.
struct TrackerBench {
    explicit TrackerBench(unsigned triggers, Nanoseconds latency = 0, std::uint32_t flags = 0,
                          std::uint32_t rate_uhz = 20'000'000) {
        camera.flags = wire::camera_enabled | flags;
        camera.rate_uhz = rate_uhz;
        camera.latency_ns = static_cast<std::uint32_t>(latency);
        camera.max_exposure_ns = 1000 * ms;
        tracker.configure(camera, 50 * ms);
        for (unsigned i = 0; i < triggers; ++i) {
            wire::Exposure record{};
            record.trigger = i + 1;
            record.tick = i + 11;
            record.trigger_ns = (100 + 50 * i) * ms;
            record.start_ns = record.end_ns = wire::no_time;
            tracker.add(record, 4 * ms);
        }
    }

    wire::CameraConfiguration camera{};
    TrackerReports reports;
    ExposureTracker tracker{3, reports};
};

}  // namespace

TEST_CASE("exposure_tracker: both edges complete the record of their trigger") {
    TrackerBench bench(2, ms);
    CHECK_FALSE(bench.tracker.empty());
    CHECK(bench.tracker.edge(101 * ms, true).trigger == 0);
    const ExposureTracker::Completed completed = bench.tracker.edge(106 * ms, false);
    CHECK(completed.trigger == 1);
    CHECK(completed.duration == 5 * ms);
    REQUIRE(bench.reports.exposures.size() == 1);
    const wire::Exposure& record = bench.reports.exposures[0];
    CHECK(record.flags == measured_flag);
    CHECK(record.trigger == 1);
    CHECK(record.start_ns == 101 * ms);
    CHECK(record.end_ns == 106 * ms);
    bench.tracker.edge(151 * ms, true);
    CHECK(bench.tracker.edge(155 * ms, false).trigger == 2);
    CHECK(bench.tracker.empty());
    CHECK(bench.tracker.next_deadline() == never);
    CHECK(bench.reports.strays.empty());
}

TEST_CASE("exposure_tracker: it takes four triggers that wait for their exposures") {
    CHECK_FALSE(TrackerBench(3).tracker.full());
    TrackerBench bench(4);
    CHECK(bench.tracker.full());
    for (Nanoseconds at = 100 * ms; at <= 250 * ms; at += 50 * ms) {
        bench.tracker.edge(at, true);
        bench.tracker.edge(at + 4 * ms, false);
    }
    CHECK(bench.reports.flags() ==
          Flags{measured_flag, measured_flag, measured_flag, measured_flag});
    CHECK(bench.reports.exposures[3].trigger == 4);
}

TEST_CASE("exposure_tracker: an exposure longer than the period is overlong") {
    for (const Nanoseconds longer : {0, 1}) {
        TrackerBench bench(1);
        bench.tracker.edge(100 * ms, true);
        bench.tracker.edge(150 * ms + longer, false);
        CHECK(bench.reports.flags() ==
              Flags{longer == 0 ? measured_flag
                                : static_cast<std::uint16_t>(measured_flag | overlong)});
    }
    TrackerBench without_rate(1, 0, 0, 0);
    without_rate.tracker.edge(100 * ms, true);
    without_rate.tracker.edge(900 * ms, false);
    CHECK(without_rate.reports.flags() == Flags{measured_flag});
}

TEST_CASE("exposure_tracker: a start sooner than half the latency belongs to no trigger") {
    // A latency of up to 0.2 ms may vary by as much as itself.
    const auto [latency, soonest] = GENERATE(table<Nanoseconds, Nanoseconds>(
        {{0, 0}, {200'000, 0}, {200'002, 100'001}, {10 * ms, 5 * ms}}));
    CAPTURE(latency);
    for (const Nanoseconds early : {0, 1}) {
        TrackerBench bench(2, latency);
        bench.tracker.edge(100 * ms + soonest - early, true);
        CHECK(bench.reports.strays.size() == (early == 0 ? 0 : 1));
        bench.tracker.edge(150 * ms + soonest - early, true);
        bench.tracker.edge(160 * ms, false);
        // The second edge is soon enough for the first trigger.
        CHECK(bench.reports.flags() ==
              (early == 0 ? Flags{no_end, measured_flag} : Flags{measured_flag}));
        CHECK(bench.reports.exposures.back().trigger == (early == 0 ? 2 : 1));
    }
}

TEST_CASE(
    "exposure_tracker: a start belongs to the newest trigger, the camera ignored the others") {
    TrackerBench bench(4);
    bench.tracker.edge(199 * ms, true);
    bench.tracker.edge(203 * ms, false);
    CHECK(bench.reports.flags() == Flags{no_start, measured_flag});
    CHECK(bench.reports.exposures[1].trigger == 2);
    bench.tracker.edge(250 * ms, true);
    CHECK(bench.reports.flags() == Flags{no_start, measured_flag, no_start});
    CHECK(bench.reports.exposures[2].start_ns == wire::no_time);
    CHECK(bench.tracker.edge(254 * ms, false).trigger == 4);
}

TEST_CASE("exposure_tracker: a new start ends the wait for an end that was missed") {
    TrackerBench bench(2);
    bench.tracker.edge(100 * ms, true);
    bench.tracker.edge(150 * ms, true);
    CHECK(bench.tracker.edge(154 * ms, false).duration == 4 * ms);
    CHECK(bench.reports.flags() == Flags{no_end, measured_flag});
}

TEST_CASE("exposure_tracker: a second start of one trigger ends it, and belongs to none") {
    TrackerBench bench(2);
    bench.tracker.edge(100 * ms, true);
    bench.tracker.edge(110 * ms, true);
    bench.tracker.edge(112 * ms, false);
    CHECK(bench.reports.flags() == Flags{no_end});
    CHECK(bench.reports.strays == Strays{{110 * ms, 1}, {112 * ms, 0}});
    bench.tracker.edge(150 * ms, true);
    CHECK(bench.tracker.edge(154 * ms, false).trigger == 2);
}

TEST_CASE("exposure_tracker: edges without a trigger are reported, and complete nothing") {
    TrackerBench bench(1);
    CHECK(bench.tracker.edge(99 * ms, true).trigger == 0);
    CHECK(bench.tracker.edge(101 * ms, false).trigger == 0);
    bench.tracker.edge(102 * ms, true);
    bench.tracker.edge(106 * ms, false);
    CHECK(bench.tracker.edge(107 * ms, false).trigger == 0);
    CHECK(bench.tracker.edge(108 * ms, true).trigger == 0);
    CHECK(bench.reports.strays ==
          Strays{{99 * ms, 1}, {101 * ms, 0}, {107 * ms, 0}, {108 * ms, 1}});
    CHECK(bench.reports.flags() == Flags{measured_flag});
}

TEST_CASE("exposure_tracker: after lost edges no end is taken for that of a start seen before") {
    TrackerBench bench(2);
    bench.tracker.edge(100 * ms, true);
    bench.tracker.edges_lost();
    bench.tracker.edge(149 * ms, false);
    CHECK(bench.reports.flags() == Flags{no_end});
    CHECK(bench.reports.exposures[0].end_ns == wire::no_time);
    CHECK(bench.reports.strays == Strays{{149 * ms, 0}});
    // What has not begun still may.
    bench.tracker.edges_lost();
    bench.tracker.edge(150 * ms, true);
    bench.tracker.edges_lost();
    CHECK(bench.reports.flags() == Flags{no_end, no_end});
    bench.tracker.edges_lost();
    CHECK(bench.reports.exposures.size() == 2);
}

TEST_CASE("exposure_tracker: what does not come in time is given up, at an edge as well") {
    const bool by_edge = GENERATE(false, true);
    TrackerBench bench(1, ms);
    const auto pass = [&](Nanoseconds at) {
        if (by_edge)
            bench.tracker.edge(at, false);
        else
            bench.tracker.expire(at);
    };
    CHECK(bench.tracker.next_deadline() == 151 * ms);
    pass(151 * ms - 1);
    CHECK(bench.reports.exposures.empty());
    pass(151 * ms);
    CHECK(bench.reports.flags() == Flags{no_start});
    CHECK(bench.tracker.busy_until(152 * ms) < 0);

    TrackerBench begun(2);
    begun.tracker.edge(110 * ms, true);
    CHECK(begun.tracker.next_deadline() == 1110 * ms);
    begun.tracker.expire(1110 * ms - 1);
    CHECK(begun.reports.exposures.empty());
    begun.tracker.edge(1110 * ms, false);
    CHECK(begun.reports.flags() == Flags{static_cast<std::uint16_t>(no_end | overlong), no_start});
    CHECK(begun.reports.strays == Strays{{1110 * ms, 0}});
    CHECK(begun.tracker.busy_until(1111 * ms) == 1110 * ms);
}

TEST_CASE("exposure_tracker: without an exposure line the record follows from the trigger") {
    TrackerBench bench(2, ms, wire::camera_no_strobe);
    CHECK(bench.tracker.next_deadline() == 105 * ms);
    bench.tracker.expire(105 * ms - 1);
    CHECK(bench.reports.exposures.empty());
    bench.tracker.expire(105 * ms);
    CHECK(bench.tracker.next_deadline() == 155 * ms);
    CHECK(bench.tracker.busy_until(105 * ms) == 155 * ms);
    bench.tracker.give_up();
    CHECK(bench.reports.flags() == Flags{predicted, predicted});
    for (unsigned i = 0; i < 2; ++i) {
        CHECK(bench.reports.exposures[i].start_ns == (101 + 50 * i) * ms);
        CHECK(bench.reports.exposures[i].end_ns == (105 + 50 * i) * ms);
    }
    CHECK(bench.tracker.busy_until(110 * ms) == 155 * ms);
}

TEST_CASE("exposure_tracker: all are given up at once, each as far as it came") {
    TrackerBench bench(3);
    bench.tracker.edge(100 * ms, true);
    bench.tracker.give_up();
    CHECK(bench.reports.flags() == Flags{no_end, no_start, no_start});
    CHECK(bench.tracker.empty());
    bench.tracker.give_up();
    CHECK(bench.reports.exposures.size() == 3);
}

TEST_CASE("exposure_tracker: a word that left late corrects its trigger's time, and says so") {
    const unsigned moved = GENERATE(0, 1, 2);
    const bool late = GENERATE(true, false);
    TrackerBench bench(3);
    const Nanoseconds asked = (100 + 50 * moved) * ms;
    bench.tracker.moved(asked, asked + ms, late);
    bench.tracker.give_up();
    for (unsigned i = 0; i < 3; ++i) {
        const wire::Exposure& record = bench.reports.exposures[i];
        CHECK(record.trigger_ns == (100 + 50 * i) * ms + (i == moved ? ms : 0));
        CHECK(record.flags == (no_start | (i == moved && late ? wire::exposure_late : 0)));
    }
}

TEST_CASE("exposure_tracker: it is busy as long as the newest exposure is expected to last") {
    TrackerBench bench(1, ms);
    CHECK(bench.tracker.busy_until(90 * ms) == 105 * ms);
    bench.tracker.edge(102 * ms, true);
    CHECK(bench.tracker.busy_until(102 * ms) == 106 * ms);
    CHECK(bench.tracker.busy_until(106 * ms) == 106 * ms);
    bench.tracker.edge(103 * ms, false);
    CHECK(bench.tracker.busy_until(103 * ms) == 103 * ms);
    bench.tracker.configure(bench.camera, 0);
    CHECK(bench.tracker.busy_until(104 * ms) == 103 * ms);

    TrackerBench two(2, ms);
    two.tracker.edge(101 * ms, true);
    CHECK(two.tracker.busy_until(105 * ms) == 155 * ms);
}

TEST_CASE("exposure_tracker: an exposure that is overdue may last for any time") {
    TrackerBench bench(2);
    bench.tracker.edge(100 * ms, true);
    CHECK(bench.tracker.busy_until(104 * ms) == 154 * ms);
    // A gap may be added to it.
    CHECK(bench.tracker.busy_until(104 * ms + 1) + 10'000 * ms > 1'000'000'000 * ms);
}

TEST_CASE(
    "exposure_tracker: the grid point of the newest trigger is known, also after its record") {
    TrackerBench bench(2);
    CHECK(bench.tracker.tick_at(100 * ms - 1) == 0);
    CHECK(bench.tracker.tick_at(100 * ms) == 11);
    CHECK(bench.tracker.tick_at(150 * ms - 1) == 11);
    CHECK(bench.tracker.tick_at(150 * ms) == 12);
    bench.tracker.edge(100 * ms, true);
    bench.tracker.edge(104 * ms, false);
    CHECK(bench.tracker.tick_at(105 * ms) == 11);
    CHECK(bench.tracker.tick_at(150 * ms) == 12);
    bench.tracker.give_up();
    CHECK(bench.tracker.tick_at(1'000 * ms) == 12);
}
