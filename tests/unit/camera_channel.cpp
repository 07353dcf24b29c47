// SPDX-License-Identifier: BSD-3-Clause
#include "camera_channel.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <utility>
#include <vector>

#include "nanoseconds.hpp"
#include "recorded_reports.hpp"

using namespace versavis;
using namespace versavis::firmware;
using namespace versavis::test;

namespace {

constexpr Nanoseconds horizon = OutputQueue::horizon;
constexpr std::uint8_t starts[] = {0, wire::start_pattern, wire::start_slow};

struct ChannelHardware final : OutputSchedule {
    std::vector<std::pair<Nanoseconds, std::uint32_t>> words;
    Nanoseconds soonest = 0;  ///< that a word can leave
    Nanoseconds push(Nanoseconds at, std::uint32_t levels) override {
        words.emplace_back(std::max(at, soonest), levels);
        return words.back().first;
    }
};

using Reports = test::RecordedReports;

/// A camera at 20 Hz that is expected to expose for 4 ms, and its outputs; grid and board time are
/// one. The test says what its exposure line does.
struct ChannelBench {
    explicit ChannelBench(std::uint32_t flags = 0) { camera.flags = wire::camera_enabled | flags; }

    static wire::CameraConfiguration default_camera() {
        wire::CameraConfiguration camera{};
        camera.rate_uhz = 20'000'000;
        camera.pulse_ns = 100 * us;
        camera.exposure_ns = 4 * ms;
        camera.max_exposure_ns = 60 * ms;
        return camera;
    }
    ChannelBench& configure(Nanoseconds lead = 0) {
        channel.configure(camera, lead);
        return *this;
    }
    /// Its first trigger is that of the grid point after `at`.
    ChannelBench& start(Nanoseconds at, std::uint8_t start_flags = 0) {
        channel.start(at, start_flags);
        now = at;
        return *this;
    }
    void poll(Nanoseconds at) {
        now = at;
        channel.poll(now, now);
        outputs.commit(now);
    }
    /// Does what is due, when it is.
    void run(Nanoseconds until) {
        while (channel.next_wake(0) <= until) poll(std::max(now, channel.next_wake(0)));
        now = until;
    }
    void expose(Nanoseconds start, Nanoseconds duration) {
        channel.exposure_edge(start, true);
        channel.exposure_edge(start + duration, false);
    }
    Nanoseconds next_trigger(Nanoseconds lead = 0) const {
        return channel.next_wake(0) + horizon + lead;
    }

    struct Moves final : OutputMoves {
        explicit Moves(ChannelBench& owner) : bench(owner) {}
        void moved(unsigned /*output*/, bool level, Nanoseconds asked, Nanoseconds left) override {
            if (level) bench.channel.moved(asked, left, true);
        }
        ChannelBench& bench;
    };

    wire::CameraConfiguration camera = default_camera();
    Moves moves{*this};
    ChannelHardware hardware;
    Reports reports;
    GridClock clock;
    OutputQueue outputs{hardware, moves, {}};
    CameraChannel channel{2, clock, outputs, reports};
    Nanoseconds now = 0;
};

/// The next trigger, of a camera that is expected to expose for `expected`, would leave at
/// 100 ms - `expected` / 2; the one before left at 48 ms, and its exposure lasts `lasts`.
struct RunningChannel : ChannelBench {
    explicit RunningChannel(std::uint32_t flags = 0) : ChannelBench(flags) {
        configure().start(20 * ms);
        run(48 * ms);
        REQUIRE(reports.planned.size() == 1);
    }
};

}  // namespace

TEST_CASE("camera_channel: the middle of an exposure belongs on its grid point") {
    ChannelBench bench;
    bench.camera.latency_ns = 300 * us;
    bench.camera.phase_ns = 7 * ms;
    bench.configure(500 * us).start(20 * ms);
    CHECK(bench.channel.running());
    const Nanoseconds trigger = 57 * ms - 2 * ms - 300 * us;
    // It is decided so much sooner than its word is due that the light can lead it.
    CHECK(bench.channel.next_wake(0) == trigger - horizon - 200 * us);
    bench.poll(bench.channel.next_wake(0) - 1);
    CHECK(bench.reports.planned.empty());
    bench.poll(bench.channel.next_wake(0));
    using Planned = std::vector<std::pair<Nanoseconds, Nanoseconds>>;
    CHECK(bench.reports.planned == Planned{{trigger + 300 * us, 4 * ms}});
    CHECK(bench.channel.next_wake(0) > bench.now + 40 * ms);
    bench.outputs.commit(trigger);
    using Words = std::vector<std::pair<Nanoseconds, std::uint32_t>>;
    CHECK(bench.hardware.words == Words{{trigger, 4}, {trigger + 100 * us, 0}});
    CHECK_FALSE(bench.channel.idle());
    bench.expose(trigger + 310 * us, 5 * ms);
    CHECK(bench.channel.idle());
    REQUIRE(bench.reports.exposures.size() == 1);
    const wire::Exposure& record = bench.reports.exposures[0];
    CHECK(record.camera == 2);
    CHECK(record.trigger == 1);
    CHECK(record.tick == 1);
    CHECK(record.trigger_ns == trigger);
    CHECK(record.start_ns == trigger + 310 * us);
    CHECK(record.end_ns == trigger + 310 * us + 5 * ms);
    CHECK(record.flags == wire::exposure_measured);
    // What was measured is expected next.
    CHECK(bench.next_trigger(200 * us) == 107 * ms - 2'500 * us - 300 * us);
}

TEST_CASE("camera_channel: a lead that the latency covers takes no time") {
    for (const Nanoseconds lead : {299 * us, 300 * us, 301 * us}) {
        ChannelBench bench;
        bench.camera.latency_ns = 300 * us;
        bench.configure(lead).start(20 * ms);
        CHECK(bench.channel.next_wake(0) ==
              48 * ms - 300 * us - horizon - std::max(lead - 300 * us, Nanoseconds{0}));
    }
}

TEST_CASE("camera_channel: triggering begins at the first grid point that can be met") {
    struct Case {
        Nanoseconds exposure;
        std::uint32_t latency;
        Nanoseconds lead;
        Nanoseconds ahead;
    };
    for (const Case& made :
         {Case{4 * ms, 0, 0, 5 * ms}, Case{8 * ms, 0, 0, 5 * ms}, Case{10 * ms, 0, 0, 6 * ms},
          Case{10 * ms, 300'000, 0, 6'300 * us}, Case{10 * ms, 300'000, 400 * us, 6'400 * us},
          Case{90 * ms, 0, 0, 31 * ms}}) {
        for (const bool missed : {false, true}) {
            ChannelBench bench;
            bench.camera.exposure_ns = made.exposure;
            bench.camera.latency_ns = made.latency;
            bench.configure(made.lead).start(1'050 * ms - made.ahead + (missed ? 1 : 0));
            bench.run(1'120 * ms);
            REQUIRE_FALSE(bench.reports.planned.empty());
            const Nanoseconds exposure = std::min(made.exposure, 60 * ms);
            CHECK(bench.reports.planned[0].second == exposure);
            CHECK(bench.reports.planned[0].first + exposure / 2 == (missed ? 1'100 : 1'050) * ms);
        }
    }
}

TEST_CASE("camera_channel: ticks count on the grid, and none is used twice until it begins anew") {
    for (const bool anew : {false, true}) {
        ChannelBench bench;
        bench.camera.exposure_ns = 30 * ms;
        bench.configure().start(1'020 * ms);
        bench.poll(1'034 * ms);  // decides tick 21
        bench.channel.stop();
        CHECK_FALSE(bench.channel.running());
        bench.channel.give_up();
        if (anew) bench.channel.grid_began();
        bench.channel.announce(0, 2 * ms);  // tick 21 could be met again
        bench.start(1'036 * ms);
        bench.run(1'150 * ms);
        bench.channel.give_up();
        REQUIRE(bench.reports.exposures.size() >= 2);
        CHECK(bench.reports.exposures[0].tick == 21);
        CHECK(bench.reports.exposures[1].tick == (anew ? 21 : 22));
        CHECK(bench.reports.exposures[1].trigger == 2);
        // At another rate they count anew, too. The triggers are counted on.
        bench.channel.stop();
        bench.reports.exposures.clear();
        bench.clock.begin(1'250 * ms, 0);
        if (anew) {
            bench.channel.grid_began();
        } else {
            bench.camera.rate_uhz = 40'000'000;
            bench.configure();
        }
        bench.start(1'200 * ms);
        bench.run(1'300 * ms);
        bench.channel.give_up();
        REQUIRE_FALSE(bench.reports.exposures.empty());
        CHECK(bench.reports.exposures[0].tick == 0);
        CHECK(bench.reports.exposures[0].trigger > 2);
    }
}

TEST_CASE("camera_channel: a start takes no longer when the grid began long ago") {
    ChannelBench bench;
    bench.camera.rate_uhz = 1'000'000'000;
    const Nanoseconds month = 30 * 86'400 * second;
    bench.configure().start(month);
    CHECK(bench.next_trigger() == month + 5 * ms - 2 * ms);
}

TEST_CASE("camera_channel: a start pattern and a slow start leave grid points out") {
    for (const std::uint8_t flags : starts) {
        ChannelBench bench(wire::camera_no_strobe);
        bench.configure().start(20 * ms);
        CHECK_FALSE(bench.channel.slow());
        bench.run(100 * ms);
        bench.channel.start(bench.now, flags);  // while it is running: from the next tick on
        CHECK(bench.channel.slow() == (flags == wire::start_slow));
        bench.run(4'020 * ms);
        std::vector<std::uint64_t> ticks;
        std::vector<std::uint64_t> expected{1, 2};
        for (std::uint64_t i = 0; i < 78; ++i) {
            const bool in_pattern = flags == wire::start_pattern && i < 20;
            if (flags == wire::start_slow ? i % 30 == 0 : !in_pattern || (0xC5A5DU >> i & 1U) != 0)
                expected.push_back(3 + i);
        }
        for (const wire::Exposure& record : bench.reports.exposures) {
            ticks.push_back(record.tick);
            unsigned phase = 0;
            if (flags == wire::start_slow && record.tick >= 3) phase = wire::exposure_slow;
            if (flags == wire::start_pattern && record.tick >= 3 && record.tick < 23)
                phase = wire::exposure_pattern;
            CHECK(record.flags == (wire::exposure_predicted | phase));
            CHECK(record.trigger == ticks.size());
        }
        CHECK(ticks == expected);
        CHECK(bench.channel.skipped() == 0);
        bench.channel.stop();
        CHECK_FALSE(bench.channel.slow());
        CHECK(bench.channel.next_wake(0) == never);
    }
}

TEST_CASE("camera_channel: a trigger waits for the end of the exposure, and the gap") {
    for (const bool fits : {true, false}) {
        ChannelBench bench;
        bench.camera.exposure_ns = 48 * ms;
        bench.camera.gap_ns = 2'000'000 + (fits ? 0 : 1);
        bench.configure().start(10 * ms);
        bench.run(80 * ms);
        CHECK(bench.reports.planned.size() == (fits ? 2 : 1));
        CHECK(bench.channel.skipped() == (fits ? 0 : 1));
        if (fits) continue;
        CHECK(
            bench.reports.events ==
            std::vector<ReportedEvent>{{wire::BoardEventKind::trigger_skipped, 2, 76 * ms, 2, 0}});
        bench.run(130 * ms);
        CHECK(bench.reports.planned.size() == 2);
        CHECK(bench.reports.planned[1].first == 126 * ms);
    }
}

TEST_CASE("camera_channel: between two pulses there is a pause of at least 10 us") {
    for (const std::uint32_t pulse : {9'990'000U, 9'990'001U, 10'000'000U}) {
        ChannelBench bench(wire::camera_no_strobe);
        bench.camera.rate_uhz = 100'000'000;
        bench.camera.pulse_ns = pulse;
        bench.configure().start(10 * ms);
        bench.run(1'012 * ms);
        CHECK(bench.reports.planned.size() == (pulse == 9'990'000 ? 100 : 50));
        CHECK(bench.channel.skipped() == (pulse == 9'990'000 ? 0 : 50));
    }
}

TEST_CASE("camera_channel: no trigger is sent that nobody can keep") {
    ChannelBench bench;
    bench.camera.rate_uhz = 1'000'000'000;
    bench.camera.exposure_ns = 100 * us;
    bench.configure().start(10 * ms);
    // What happened is not known for a while.
    for (Nanoseconds at = 10 * ms; at < 20 * ms; at += ms / 4) {
        bench.channel.poll(at, 10 * ms);
        bench.outputs.commit(at);
    }
    CHECK(bench.reports.planned.size() == 4);
    REQUIRE_FALSE(bench.reports.events.empty());
    CHECK(bench.reports.events[0] ==
          ReportedEvent{wire::BoardEventKind::trigger_skipped, 2, 19 * ms - 50 * us, 19, 2});
}

TEST_CASE("camera_channel: a trigger that the outputs have no room for is skipped") {
    for (const unsigned edges : {22U, 23U}) {
        ChannelBench bench;
        bench.configure().start(20 * ms);
        for (unsigned i = 0; i < edges; ++i) bench.outputs.set(60 * second, 2, true);
        bench.run(48 * ms);
        CHECK(bench.reports.planned.size() == (edges == 22 ? 1 : 0));
        CHECK(bench.channel.skipped() == (edges == 22 ? 0 : 1));
        if (edges == 23)
            CHECK(bench.reports.events ==
                  std::vector<ReportedEvent>{
                      {wire::BoardEventKind::trigger_skipped, 2, 48 * ms, 1, 2}});
    }
}

TEST_CASE("camera_channel: a late trigger is sent within a sixteenth of the period, or 1 ms") {
    struct Case {
        std::uint32_t rate_uhz;
        Nanoseconds limit;
    };
    for (const Case& made : {Case{20'000'000, ms}, Case{62'500'000, ms}, Case{62'600'000, 998'402},
                             Case{100'000'000, 625 * us}, Case{1'000'000'000, 62'500}})
        for (const Nanoseconds beyond : {0, 1}) {
            ChannelBench bench;
            bench.camera.rate_uhz = made.rate_uhz;
            bench.camera.exposure_ns = 200 * us;
            bench.configure().start(20 * ms);
            const Nanoseconds trigger = bench.next_trigger();
            const auto tick = (trigger + 100 * us) * made.rate_uhz / 1'000'000 / second;
            bench.poll(trigger + made.limit + beyond);
            if (beyond == 0) {
                REQUIRE_FALSE(bench.reports.planned.empty());
                CHECK(bench.reports.planned[0].first == bench.now);
                CHECK(bench.channel.skipped() == 0);
                bench.expose(bench.now, 200 * us);
                CHECK(bench.reports.exposures.at(0).trigger_ns == bench.now);
                CHECK(bench.reports.exposures[0].flags ==
                      (wire::exposure_measured | wire::exposure_late));
            } else {
                REQUIRE_FALSE(bench.reports.events.empty());
                CHECK(bench.reports.events[0].kind == wire::BoardEventKind::trigger_skipped);
                CHECK(bench.reports.events[0].at == trigger);
                CHECK(std::abs(bench.reports.events[0].value - tick) <= 1);
                CHECK(bench.reports.events[0].detail == 1);
                CHECK(bench.channel.skipped() == 1);
            }
        }
}

TEST_CASE("camera_channel: triggers in a row that were too late are reported together") {
    using Events = std::vector<ReportedEvent>;
    const auto kind = wire::BoardEventKind::triggers_skipped;
    struct Case {
        Nanoseconds late;  ///< beyond what is still sent
        Events events;
        std::uint32_t skipped;
    };
    const Nanoseconds trigger = 48 * ms;
    const Nanoseconds period = 50 * ms;
    for (const Case& made :
         {Case{period - 1, {{wire::BoardEventKind::trigger_skipped, 2, trigger, 1, 1}}, 1},
          Case{period + 1, {{kind, 2, trigger, 1, 2}}, 2},
          Case{2 * period - 1, {{kind, 2, trigger, 1, 2}}, 2},
          Case{65'534 * period + 1, {{kind, 2, trigger, 1, 65'535}}, 65'535},
          Case{65'535 * period + 1,
               {{kind, 2, trigger, 1, 65'535},
                {wire::BoardEventKind::trigger_skipped, 2, trigger + 65'535 * period, 65'536, 1}},
               65'536},
          Case{69'999 * period + 1,
               {{kind, 2, trigger, 1, 65'535}, {kind, 2, trigger + 65'535 * period, 65'536, 4'465}},
               70'000}}) {
        ChannelBench bench;
        bench.configure().start(20 * ms);
        bench.poll(trigger + ms + made.late);
        CHECK(bench.reports.events == made.events);
        CHECK(bench.channel.skipped() == made.skipped);
        // The next one may still be sent.
        const auto sent = static_cast<Nanoseconds>(bench.reports.planned.size());
        CHECK(bench.next_trigger() == trigger + (made.skipped + sent) * period);
    }
}

TEST_CASE("camera_channel: of what is skipped, only wanted grid points count") {
    for (const std::uint8_t flags : starts)
        for (unsigned since = 0; since < 32; ++since)
            for (unsigned ticks = 1; ticks < 35; ++ticks) {
                const auto wanted = [flags](unsigned tick) {
                    if (flags == wire::start_slow) return tick % 30 == 0;
                    return flags != wire::start_pattern || tick >= 20 ||
                           (0xC5A5DU >> tick & 1U) != 0;
                };
                ChannelBench bench(wire::camera_no_strobe);
                bench.configure().start(20 * ms, flags);
                for (unsigned i = 0; i < since; ++i) bench.poll(bench.channel.next_wake(0));
                while (bench.channel.next_wake(0) < (47 + 50 * since) * ms)
                    bench.poll(bench.channel.next_wake(0));
                std::uint32_t skipped = 0;
                for (unsigned i = 0; i < ticks; ++i) skipped += wanted(since + i) ? 1 : 0;
                bench.poll((48 + 50 * (since + ticks - 1)) * ms + ms + 1);
                REQUIRE(bench.channel.skipped() == skipped);
                const bool single = ticks == 1 && skipped == 1;
                REQUIRE(bench.reports.events.size() == (skipped > 0 ? 1 : 0));
                if (skipped == 0) continue;
                const ReportedEvent& event = bench.reports.events[0];
                REQUIRE(event.kind == (single ? wire::BoardEventKind::trigger_skipped
                                              : wire::BoardEventKind::triggers_skipped));
                REQUIRE(event.value == since + 1);
                REQUIRE(event.detail == static_cast<int>(single ? 1 : skipped));
            }
}

TEST_CASE("camera_channel: one poll decides two triggers") {
    ChannelBench bench;
    bench.camera.rate_uhz = 1'000'000'000;
    bench.camera.exposure_ns = 100 * us;
    bench.configure().start(10 * ms, wire::start_slow);  // at tick 15, 1515, ...
    bench.run(20 * ms);
    const Nanoseconds due = bench.channel.next_wake(0);
    const Nanoseconds late = due + 2 * ms;  // three are due, and the first has passed
    bench.channel.poll(late, 0);
    CHECK(bench.channel.next_wake(0) == due + 2 * ms);
    bench.channel.poll(late, 0);
    CHECK(bench.channel.next_wake(0) == due + 3 * ms);
}

TEST_CASE("camera_channel: an inverted trigger is low, and one that leaves late says when it did") {
    ChannelBench bench(wire::camera_trigger_inverted);
    bench.configure();
    CHECK(bench.channel.trigger_inverted());
    bench.outputs.set(ms, 2, true);
    bench.outputs.commit(ms);
    bench.start(20 * ms);
    bench.run(47 * ms);
    using Words = std::vector<std::pair<Nanoseconds, std::uint32_t>>;
    CHECK(bench.hardware.words == Words{{ms, 4}, {48 * ms, 0}});
    bench.outputs.commit(48 * ms);
    CHECK(bench.hardware.words == Words{{ms, 4}, {48 * ms, 0}, {48 * ms + 100 * us, 4}});

    RunningChannel world;
    world.channel.moved(48 * ms, 49 * ms, true);
    world.expose(49 * ms, 4 * ms);
    REQUIRE(world.reports.exposures.size() == 1);
    CHECK(world.reports.exposures[0].trigger_ns == 49 * ms);
    CHECK(world.reports.exposures[0].flags == (wire::exposure_measured | wire::exposure_late));
}

TEST_CASE("camera_channel: what is announced is expected from its trigger on, and reported") {
    RunningChannel world;
    world.expose(48 * ms, 4 * ms);
    world.channel.announce(3, 10 * ms);
    CHECK(world.next_trigger() == 98 * ms);
    world.channel.announce(2, 60 * ms);  // at most; this one and those after it
    CHECK(world.next_trigger() == 70 * ms);
    world.channel.announce(2, 60 * ms + 1);
    CHECK(world.next_trigger() == 70 * ms);
    world.run(69 * ms);
    world.channel.announce(3, 60 * ms);
    world.expose(70 * ms, 20 * ms);
    world.run(124 * ms);
    world.channel.give_up();
    REQUIRE(world.reports.exposures.size() == 3);
    CHECK(world.reports.planned[1] == std::pair{70 * ms, 60 * ms});
    CHECK(world.reports.planned[2] == std::pair{120 * ms, 60 * ms});
    CHECK(world.reports.exposures[0].flags == wire::exposure_measured);
    CHECK(world.reports.exposures[1].flags ==
          (wire::exposure_measured | wire::exposure_announced | wire::exposure_clipped));
    CHECK(world.reports.exposures[2].flags == (wire::exposure_no_start | wire::exposure_announced));
    // That it was announced holds for one trigger; what is expected stays.
    CHECK(world.next_trigger() == 170 * ms);
    world.run(170 * ms);
    world.channel.give_up();
    CHECK(world.reports.exposures.back().flags == wire::exposure_no_start);
}

TEST_CASE("camera_channel: an exposure from before an announcement does not override it") {
    ChannelBench bench;
    bench.camera.exposure_ns = 48 * ms;
    bench.configure().start(10 * ms);
    bench.run(26 * ms);
    bench.channel.announce(2, 50'800 * us);
    bench.run(73'700 * us);  // it is decided while the first exposure lasts
    CHECK(bench.reports.planned.size() == 2);
    bench.expose(26 * ms, 48 * ms);
    CHECK(bench.next_trigger() == 150 * ms - 25'400 * us);
    // But what the camera makes of the announcement does.
    bench.expose(74'600 * us, 6 * ms);
    CHECK(bench.next_trigger() == 147 * ms);
    // And a line that ends nothing says nothing.
    bench.channel.exposure_edge(90 * ms, false);
    CHECK(bench.next_trigger() == 147 * ms);
    CHECK(bench.reports.events ==
          std::vector<ReportedEvent>{{wire::BoardEventKind::stray_edge, 2, 90 * ms, 0, 0}});
}

TEST_CASE("camera_channel: before any trigger, an edge says nothing about exposures") {
    ChannelBench bench;
    bench.configure().start(20 * ms);
    bench.channel.exposure_edge(30 * ms, false);
    CHECK(bench.next_trigger() == 48 * ms);
}

TEST_CASE("camera_channel: a new configuration forgets announcements and measurements") {
    RunningChannel world;
    world.expose(48 * ms, 20 * ms);
    world.channel.announce(2, 10 * ms);
    world.channel.announce(3, 30 * ms);
    world.channel.stop();
    world.configure().start(70 * ms);
    CHECK(world.next_trigger() == 98 * ms);
    world.run(98 * ms);
    world.expose(98 * ms, 6 * ms);
    CHECK(world.reports.exposures.back().flags == wire::exposure_measured);
    CHECK(world.next_trigger() == 147 * ms);
}

TEST_CASE("camera_channel: a start is waited for one period, at least 2 ms, at most 50 ms") {
    struct Case {
        std::uint32_t rate_uhz;
        Nanoseconds patience;
    };
    for (const Case& made :
         {Case{1'000'000'000, 2 * ms}, Case{500'000'000, 2 * ms}, Case{400'000'000, 2'500 * us},
          Case{20'000'000, 50 * ms}, Case{10'000'000, 50 * ms}}) {
        ChannelBench bench;
        bench.camera.rate_uhz = made.rate_uhz;
        bench.camera.exposure_ns = 100 * us;
        bench.camera.latency_ns = 300 * us;
        bench.configure().start(20 * ms);
        const Nanoseconds trigger = bench.next_trigger();
        bench.poll(trigger - horizon);
        bench.channel.stop();
        bench.poll(trigger);
        const Nanoseconds until = trigger + 300 * us + made.patience;
        CHECK(bench.channel.next_wake(0) == until);
        CHECK(bench.channel.next_wake(5 * us) == until + 5 * us);
        bench.channel.poll(until + ms, until - 1);
        CHECK(bench.reports.exposures.empty());
        bench.channel.poll(until + ms, until);
        REQUIRE(bench.reports.exposures.size() == 1);
        CHECK(bench.reports.exposures[0].flags == wire::exposure_no_start);
        CHECK(bench.channel.next_wake(0) == never);
    }
}

TEST_CASE("camera_channel: nobody gives up on a pulse that has not left yet") {
    ChannelBench bench;
    bench.configure().start(20 * ms);
    bench.channel.poll(47 * ms, 47 * ms);
    bench.channel.stop();
    bench.channel.poll(200 * ms, 200 * ms);
    CHECK(bench.reports.exposures.empty());
    bench.hardware.soonest = 300 * ms;
    bench.outputs.commit(200 * ms);
    bench.outputs.commit(300 * ms);
    bench.channel.poll(349 * ms, 349 * ms);
    CHECK(bench.reports.exposures.empty());
    bench.channel.poll(350 * ms, 350 * ms);
    REQUIRE(bench.reports.exposures.size() == 1);
    CHECK(bench.reports.exposures[0].trigger_ns == 300 * ms);
}

TEST_CASE("camera_channel: when the clock of the grid moves, the next trigger does") {
    RunningChannel world;
    world.clock.begin(ms, 0);
    CHECK(world.next_trigger() == 98 * ms);
    world.channel.grid_moved();
    CHECK(world.next_trigger() == 99 * ms);
    world.channel.stop();
    world.channel.grid_moved();
    CHECK_FALSE(world.channel.running());
    world.run(second);
    CHECK(world.reports.planned.size() == 1);
}

TEST_CASE("camera_channel: an exposure line must keep its level, as long as is configured") {
    for (const unsigned glitch : {0U, 20U}) {
        ChannelBench bench(wire::camera_strobe_inverted);
        bench.camera.glitch = static_cast<std::uint8_t>(glitch);
        bench.configure();
        const Nanoseconds width = glitch == 0 ? 5'000 : 2'000;
        CHECK_FALSE(bench.channel.is_bouncing());
        bench.channel.edge(ms, false);  // it is low while exposing
        CHECK(bench.channel.is_bouncing());
        CHECK(bench.channel.next_wake(0) == ms + width);
        CHECK(bench.channel.next_wake(3 * us) == ms + width + 3 * us);
        CHECK(bench.channel.settled(ms + width) == ms);
        Nanoseconds at = 0;
        bool exposing = false;
        CHECK_FALSE(bench.channel.take_edge(ms + width - 1, at, exposing));
        REQUIRE(bench.channel.take_edge(ms + width, at, exposing));
        CHECK(at == ms);
        CHECK(exposing);
        CHECK(bench.channel.next_wake(0) == never);
        bench.channel.edge(2 * ms, true);
        bench.channel.edge(2 * ms + 1, false);
        CHECK_FALSE(bench.channel.take_edge(3 * ms, at, exposing));
        CHECK(bench.channel.take_glitches() == 2);
        bench.channel.edge(4 * ms, true);
        bench.channel.edges_lost();
        CHECK_FALSE(bench.channel.is_bouncing());
    }
}

TEST_CASE("camera_channel: edges that were lost end the wait for the end of an exposure") {
    RunningChannel world;
    world.channel.exposure_edge(48 * ms, true);
    world.channel.edges_lost();
    REQUIRE(world.reports.exposures.size() == 1);
    CHECK(world.reports.exposures[0].flags == wire::exposure_no_end);
}

TEST_CASE("camera_channel: a camera that is off, or has no exposure line, has no edges") {
    ChannelBench off;
    CHECK(off.channel.next_wake(0) == never);
    off.camera.flags = 0;
    off.configure().start(20 * ms);
    CHECK_FALSE(off.channel.running());
    CHECK(off.channel.next_wake(0) == never);
    off.channel.exposure_edge(30 * ms, true);
    CHECK(off.reports.events.empty());

    RunningChannel world(wire::camera_no_strobe);
    world.channel.exposure_edge(49 * ms, true);
    world.channel.exposure_edge(51 * ms, false);
    CHECK(world.reports.events.empty());
    CHECK(world.channel.next_wake(0) == 52 * ms);
    world.run(52 * ms);
    REQUIRE(world.reports.exposures.size() == 1);
    CHECK(world.reports.exposures[0].start_ns == 48 * ms);
    CHECK(world.reports.exposures[0].end_ns == 52 * ms);
}

namespace {

/// A slave with a latency of 300 us; its master's exposures last 4 ms.
struct Slave : ChannelBench {
    explicit Slave(std::uint32_t flags = 0) : ChannelBench(wire::camera_slave | flags) {
        camera.master = 1;
        camera.latency_ns = 300 * us;
        configure();
    }
    void master_exposes(Nanoseconds at) {
        channel.master_edge(at, true, static_cast<std::uint64_t>(at / ms));
        channel.master_edge(at + 4 * ms, false, 0);
    }
    std::vector<Nanoseconds> triggers() const {
        std::vector<Nanoseconds> out;
        for (const wire::Exposure& record : reports.exposures) out.push_back(record.trigger_ns);
        return out;
    }
};

}  // namespace

TEST_CASE("camera_channel: a slave has a record of each pulse that its master passed on") {
    Slave slave(wire::camera_no_strobe);
    CHECK(slave.channel.master() == 1);
    slave.start(ms);  // its master is started instead
    CHECK_FALSE(slave.channel.running());
    slave.master_exposes(10 * ms);
    slave.channel.route(50 * ms, true);
    CHECK(slave.channel.running());
    CHECK(slave.channel.next_wake(0) == never);
    for (const Nanoseconds at : {50 * ms - 1, 50 * ms, 100 * ms}) slave.master_exposes(at - 5);
    slave.master_exposes(150 * ms);
    CHECK(slave.triggers() == std::vector<Nanoseconds>{100 * ms - 5, 150 * ms});
    slave.channel.unroute(200 * ms, true);
    CHECK_FALSE(slave.channel.running());
    slave.master_exposes(200 * ms - 1);
    slave.master_exposes(205 * ms);
    slave.channel.route(250 * ms, true);
    slave.master_exposes(250 * ms - 1);
    slave.master_exposes(255 * ms);
    CHECK(slave.triggers() ==
          std::vector<Nanoseconds>{100 * ms - 5, 150 * ms, 200 * ms - 1, 255 * ms});
    CHECK(slave.reports.events.empty());
    std::uint64_t trigger = 0;
    for (const wire::Exposure& record : slave.reports.exposures) {
        CHECK(record.trigger == ++trigger);
        CHECK(record.tick == static_cast<std::uint64_t>(record.trigger_ns / ms));
        // Its light is its master's: no latency is waited for, and it is measured.
        CHECK(record.start_ns == record.trigger_ns);
        CHECK(record.end_ns == record.trigger_ns + 4 * ms);
        CHECK(record.flags == (wire::exposure_measured | wire::exposure_from_master));
    }
    // From a new configuration on it is not switched on.
    slave.configure();
    slave.master_exposes(300 * ms);
    CHECK(slave.reports.exposures.size() == 4);
}

TEST_CASE("camera_channel: a slave's pulses are counted from the instant of the switch") {
    Slave slave(wire::camera_no_strobe);
    slave.channel.route(50 * ms, true);
    slave.master_exposes(50 * ms);
    slave.channel.unroute(100 * ms, true);
    slave.master_exposes(100 * ms);
    CHECK(slave.triggers() == std::vector<Nanoseconds>{50 * ms});
}

TEST_CASE("camera_channel: a slave with an exposure line of its own is stamped by that") {
    Slave slave;
    slave.channel.route(10 * ms, true);
    slave.master_exposes(50 * ms);
    CHECK(slave.reports.exposures.empty());
    CHECK(slave.channel.next_wake(0) == 50 * ms + 300 * us + 50 * ms);
    slave.expose(50 * ms + 310 * us, 4 * ms);
    REQUIRE(slave.reports.exposures.size() == 1);
    CHECK(slave.reports.exposures[0].flags == wire::exposure_measured);
    CHECK(slave.reports.exposures[0].trigger_ns == 50 * ms);
    CHECK(slave.reports.exposures[0].start_ns == 50 * ms + 310 * us);
    // When its line is cut, nothing is waited for that can no longer come.
    for (int i = 0; i < 4; ++i) slave.master_exposes((60 + 10 * i) * ms);
    CHECK(slave.reports.exposures.size() == 1);
    slave.master_exposes(100 * ms);
    CHECK(slave.reports.exposures.size() == 5);
    slave.channel.give_up();
    slave.poll(104 * ms);
    slave.reports.exposures.clear();
    slave.master_exposes(105 * ms);
    slave.poll(155 * ms + 300 * us - 1);
    CHECK(slave.reports.exposures.empty());
    slave.poll(155 * ms + 300 * us);
    REQUIRE(slave.reports.exposures.size() == 1);
    CHECK(slave.reports.exposures.back().flags == wire::exposure_no_start);
}

TEST_CASE("camera_channel: a slave whose pulses may be miscounted says so, until switched anew") {
    constexpr unsigned plain = wire::exposure_measured | wire::exposure_from_master;
    constexpr unsigned uncounted = plain | wire::exposure_uncounted;
    Slave slave(wire::camera_no_strobe);
    Nanoseconds now = 0;
    const auto flags = [&slave, &now] {
        slave.master_exposes(now += 10 * ms);
        return slave.reports.exposures.back().flags;
    };
    slave.channel.route(0, false);
    CHECK(flags() == uncounted);
    CHECK(flags() == uncounted);
    slave.channel.unroute(now += 50 * ms, true);
    slave.channel.route(now, true);
    CHECK(flags() == plain);
    slave.channel.edges_lost();
    CHECK(flags() == uncounted);
    slave.channel.route(now, true);
    CHECK(flags() == plain);
    // Edges that come after they were passed on.
    slave.channel.unroute(now + 50 * ms, false);
    CHECK(flags() == uncounted);
    slave.channel.route(now, false);
    slave.channel.unroute(now + 50 * ms, true);
    CHECK(flags() == uncounted);
}
