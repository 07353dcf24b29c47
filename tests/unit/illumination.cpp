// SPDX-License-Identifier: BSD-3-Clause
#include "illumination.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "nanoseconds.hpp"

using namespace versavis;
using namespace versavis::firmware;
using namespace versavis::test;

namespace {

struct LightHardware final : OutputSchedule {
    std::uint32_t levels = 0;
    unsigned words = 0;
    std::vector<Nanoseconds> changes[output_count];
    Nanoseconds push(Nanoseconds at, std::uint32_t wanted) override {
        ++words;
        for (unsigned output = 0; output < output_count; ++output)
            if (((levels ^ wanted) >> output & 1U) != 0) changes[output].push_back(at);
        levels = wanted;
        return at;
    }
};

struct IgnoredMoves final : OutputMoves {
    void moved(unsigned /*output*/, bool /*level*/, Nanoseconds /*asked*/,
               Nanoseconds /*left*/) override {}
};

struct Limited {
    unsigned source;
    Nanoseconds at;
    std::int64_t value;
    bool operator==(const Limited& other) const {
        return source == other.source && at == other.at && value == other.value;
    }
};

struct LightReports final : ChannelReports {
    std::vector<Limited> all;
    void exposure(const wire::Exposure& /*record*/) override {}
    void event(wire::BoardEventKind kind, std::uint8_t source, Nanoseconds at, std::int64_t value,
               std::uint16_t /*detail*/) override {
        CHECK(kind == wire::BoardEventKind::illumination_limited);
        all.push_back({source, at, value});
    }
    void exposure_planned(std::uint8_t /*camera*/, Nanoseconds /*start*/,
                          Nanoseconds /*duration*/) override {}
};

using Times = std::vector<Nanoseconds>;

/// Light for cameras 0, 1 and 7, 0.1 ms before they expose: for up to 10 ms, and a tenth of the
/// time, unless a test wants it otherwise.
struct IlluminationBench {
    explicit IlluminationBench(Nanoseconds longest = 10 * ms, std::uint32_t duty_ppm = 100'000) {
        configuration.cameras = 0b1000'0011;
        configuration.lead_ns = 100 * us;
        configuration.max_on_ns = static_cast<std::uint32_t>(longest);
        configuration.duty_ppm = duty_ppm;
        light.configure(configuration, 0);
    }

    void poll(Nanoseconds now) {
        light.poll(now, now);
        queue.commit(now);
    }
    /// Until `end`, like a board with nothing else to do.
    void run(Nanoseconds end) {
        for (Nanoseconds now = polled; now <= end; now += 50 * us) poll(now);
        poll(end);
        polled = end;
    }
    void edge(Nanoseconds at, std::uint8_t camera, bool exposing) {
        run(at);
        light.edge(camera, exposing);
        poll(at);
    }
    /// An exposure with a line, planned 5 ms ahead.
    void expose(std::uint8_t camera, Nanoseconds start, Nanoseconds end) {
        run(start - 5 * ms);
        light.plan(camera, start, end - start, true, start - 5 * ms);
        edge(start, camera, true);
        edge(end, camera, false);
    }
    /// On-time that is there at `at`: a line that is stuck takes all.
    Nanoseconds budget(Nanoseconds at) {
        const std::size_t before = gate().size();
        const Nanoseconds start = at + configuration.lead_ns;
        run(start - 5 * ms);
        light.plan(0, start, ms, true, start - 5 * ms);
        edge(start, 0, true);
        run(at + 30 * ms);
        if (gate().size() != before + 2) return 0;
        CHECK(gate()[before] == at);
        return gate()[before + 1] - at;
    }
    const Times& gate() const { return hardware.changes[output_light_gate]; }
    const Times& lead() const { return hardware.changes[output_light_lead]; }

    LightHardware hardware;
    IgnoredMoves moves;
    LightReports reports;
    OutputQueue queue{hardware, moves, {}};
    Illumination light{queue, reports};
    wire::IlluminationConfiguration configuration{};
    Nanoseconds polled = 0;
};

}  // namespace

TEST_CASE("illumination: the gate is open from one lead before the exposure until its end") {
    IlluminationBench bench;
    CHECK(bench.light.next_wake(7) == never);
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    CHECK(bench.light.next_wake(7) == 11'900 * us + 7);
    bench.edge(10 * ms, 0, true);
    CHECK(bench.light.next_wake(7) == 19'900 * us + 7);
    bench.edge(14 * ms, 0, false);
    bench.run(40 * ms);
    CHECK(bench.gate() == Times{9'900 * us, 14 * ms});
    CHECK(bench.lead() == Times{9'900 * us, 10'050 * us});
    CHECK(bench.hardware.words == 3);
    CHECK(bench.light.next_wake(7) == never);
    CHECK(bench.reports.all.empty());
}

TEST_CASE("illumination: it is no matter of other cameras, or before it is configured") {
    IlluminationBench bench;
    bench.light.plan(2, 10 * ms, ms, true, ms);
    bench.run(9 * ms);
    CHECK(bench.queue.empty());
    bench.light.plan(7, 10 * ms, ms, true, 9 * ms);
    bench.edge(10 * ms, 7, true);
    bench.edge(10'100 * us, 6, true);
    bench.edge(11 * ms, 7, false);
    bench.edge(11'100 * us, 6, false);
    CHECK(bench.gate() == Times{9'900 * us, 11 * ms});

    Illumination dark(bench.queue, bench.reports);
    dark.poll(0, -1);  // at power-up
    dark.poll(20 * ms, 20 * ms);
    dark.plan(0, 25 * ms, ms, true, 20 * ms);
    CHECK(bench.queue.empty());
    CHECK(bench.reports.all.empty());
}

TEST_CASE("illumination: it is on until the last of its cameras is done") {
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    bench.light.plan(1, 10 * ms, 4 * ms, true, ms);
    bench.edge(10 * ms, 0, true);
    bench.edge(10 * ms, 1, true);
    bench.edge(13 * ms, 0, false);
    bench.edge(14 * ms, 1, false);
    CHECK(bench.gate() == Times{9'900 * us, 14 * ms});
}

TEST_CASE("illumination: when no exposure comes, it ends after 2 ms, and not before the lead") {
    const bool strobe = GENERATE(true, false);
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, strobe, ms);
    const Nanoseconds lead_off = strobe ? 10'050 * us : 14 * ms;
    const Nanoseconds end = strobe ? 11'900 * us : 14 * ms;
    bench.run(end - 1);
    CHECK(bench.gate() == Times{9'900 * us});
    bench.run(end);
    // The word with the end of the lead is out by then.
    CHECK(bench.gate() == Times{9'900 * us, strobe ? end : end + 1});
    CHECK(bench.lead() == Times{9'900 * us, lead_off});
}

TEST_CASE("illumination: a second camera that is late gets light, too, whenever it is looked at") {
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);  // it ignores its trigger
    bench.light.plan(1, 11'500 * us, 4 * ms, true, ms);
    if (GENERATE(true, false)) bench.run(12 * ms);
    bench.edge(13'200 * us, 1, true);
    bench.edge(17 * ms, 1, false);
    CHECK(bench.gate() == Times{9'900 * us, 17 * ms});
}

TEST_CASE("illumination: an end before the light is not the end of the light") {
    IlluminationBench bench;
    const bool planned = GENERATE(true, false);
    if (planned) bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    bench.edge(9 * ms, 1, true);
    bench.edge(9'500 * us, 1, false);
    if (!planned) bench.light.plan(0, 10 * ms, 4 * ms, true, 9'600 * us);
    bench.edge(11 * ms, 0, true);  // late, but in time for light
    bench.edge(15 * ms, 0, false);
    CHECK(bench.gate() == Times{9'900 * us, 15 * ms});
}

TEST_CASE("illumination: lost edges leave it on for as long as an exposure may come") {
    const bool ended = GENERATE(true, false);
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    bench.edge(10 * ms, 0, true);
    if (ended) {
        bench.run(10'050 * us);
        bench.light.edge(0, false);
    }
    bench.light.edges_lost(0xF);
    bench.run(20 * ms);
    CHECK(bench.gate() == Times{9'900 * us, 11'900 * us});
}

TEST_CASE("illumination: a line that is stuck costs one longest light, and a dark pause") {
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    bench.edge(10 * ms, 0, true);
    bench.run(19'900 * us - 1);
    CHECK(bench.reports.all.empty());
    bench.light.plan(1, 20 * ms + 100 * us, 4 * ms, true, 19'900 * us - 1);
    bench.run(30 * ms);
    // Earned meanwhile: a tenth of the 11 ms from 9.9 to 20.9.
    CHECK(bench.gate() == Times{9'900 * us, 19'900 * us, 20'900 * us, 22 * ms});
    CHECK(bench.reports.all == std::vector<Limited>{{output_light_gate, 19'900 * us, 10 * ms},
                                                    {output_light_gate, 22 * ms, 1'100 * us}});
}

TEST_CASE("illumination: light that was not wanted any longer was not limited") {
    // With a budget of 1 ms the gate closes at 10.9 ms.
    for (const Nanoseconds longer : {0, 1}) {
        IlluminationBench bench(ms);
        for (int i = 0; i < 2; ++i) bench.light.plan(0, 10 * ms, 5 * ms, false, 0);
        bench.light.stop(ms);
        bench.light.plan(0, 10 * ms, 900 * us + longer, false, ms);
        bench.run(11 * ms);
        CHECK(bench.reports.all.size() == (longer == 0 ? 0 : 1));
        IlluminationBench next(ms, 1'000'000);
        next.light.plan(0, 10 * ms, 500 * us, false, ms);
        next.light.plan(0, 11 * ms - longer, 5 * ms, false, ms);
        next.run(11 * ms);
        CHECK(next.reports.all.size() == (longer == 0 ? 0 : 1));
        // A dark pause of a tenth, if it was.
        CHECK(next.gate().at(2) == (longer == 0 ? 10'900 * us + 1 : 11 * ms));
    }
}

TEST_CASE("illumination: on-time is earned by the duty, and spent while the gate is open") {
    IlluminationBench full;
    CHECK(full.budget(100'000 * ms) == 10 * ms);
    for (const std::uint32_t duty_ppm : {100'000U, 1U, 123'457U}) {
        CAPTURE(duty_ppm);
        IlluminationBench bench(10 * ms, duty_ppm);
        bench.expose(0, 10 * ms, 14 * ms);
        // Of 10 ms at 9.9 ms 5.9 are left, and what the duty gives until 24 ms is earned.
        const auto by_duty = [duty_ppm](Nanoseconds span) { return span * duty_ppm / 1'000'000; };
        const Nanoseconds left = 5'900 * us - by_duty(5'900 * us);
        CHECK(bench.budget(24 * ms) ==
              std::min(10 * ms, left + by_duty(10 * ms) + by_duty(10 * ms)));
    }
    IlluminationBench slow(10 * ms, 1);
    CHECK(slow.budget(10 * ms) == 10 * ms);
    slow.polled = 999'000 * ms;
    CHECK(slow.budget(1'000'000 * ms) == 999'990);
}

TEST_CASE("illumination: after years of darkness one longest light has been earned") {
    IlluminationBench bench(1'000 * ms, 1);
    bench.expose(0, 10 * ms, 500 * ms);
    constexpr Nanoseconds years = 300'000'000'000 * ms;
    bench.polled = years;
    bench.light.plan(1, years + 10 * ms, ms, true, years);
    bench.edge(years + 10 * ms, 1, true);
    CHECK(bench.light.next_wake(0) == years + 9'900 * us + 1'000 * ms);
}

TEST_CASE("illumination: with too little on-time it stays dark, and says so") {
    // After 1 ms of light until 10.9 ms, a hundredth of the time since 9.9 is there: enough for the
    // lead and 10 us at 20.9.
    for (const Nanoseconds early : {0, 100}) {
        IlluminationBench bench(ms, 10'000);
        bench.light.plan(0, 10 * ms, ms, true, ms);
        bench.edge(10 * ms, 0, true);
        bench.edge(15 * ms, 0, false);
        bench.reports.all.clear();
        bench.light.plan(0, 21 * ms - early, ms, true, 15 * ms);
        bench.light.plan(0, 41 * ms, ms, true, 15 * ms);
        bench.run(22 * ms);
        const bool enough = early == 0;
        CHECK(bench.gate().size() == (enough ? 4 : 2));
        if (enough) CHECK(bench.gate()[3] == 20'900 * us + 110 * us);
        if (!enough)
            CHECK(bench.reports.all ==
                  std::vector<Limited>{{output_light_gate, 20'900 * us - early, 0}});
        bench.run(50 * ms);
        CHECK(bench.gate()[enough ? 4 : 2] == 40'900 * us);  // the next one has enough
    }
}

TEST_CASE("illumination: a lead whose light was refused ends when another is planned") {
    IlluminationBench bench(ms, 10'000);
    bench.light.plan(0, 10 * ms, ms, true, ms);
    bench.light.plan(1, 10 * ms, ms, true, ms);
    bench.edge(10 * ms, 0, true);
    bench.edge(15 * ms, 0, false);
    bench.light.plan(0, 16 * ms, 9 * ms, false, 15'500 * us);
    bench.run(16 * ms);
    bench.light.plan(0, 40 * ms, ms, true, 17 * ms);
    bench.run(41 * ms);
    CHECK(bench.lead() ==
          Times{9'900 * us, 10'050 * us, 15'900 * us, 17 * ms, 39'900 * us, 40'050 * us});
}

TEST_CASE("illumination: what leaves late is paid for") {
    struct Case {
        bool open;
        Nanoseconds asked, left, cost;
    };
    for (const Case& one :
         {Case{false, 14 * ms, 14'500 * us, 500 * us}, Case{false, 14 * ms, 1'000 * ms, 10 * ms},
          Case{false, 13 * ms, 17 * ms, 0}, Case{true, 14 * ms, 18 * ms, 0}}) {
        IlluminationBench bench;
        bench.expose(0, 10 * ms, 14 * ms);
        bench.light.moved(one.open, one.asked, one.left);
        // A tenth of 54.1 ms more.
        CHECK(bench.budget(64 * ms) == std::min(10 * ms, 11'310 * us - one.cost));
    }
    IlluminationBench stuck;
    stuck.light.plan(0, 10 * ms, 4 * ms, true, ms);
    stuck.edge(10 * ms, 0, true);
    stuck.edge(30 * ms, 0, false);
    stuck.light.moved(false, 19'900 * us, 20'900 * us);
    CHECK(stuck.budget(59'900 * us) == 4 * ms);
}

TEST_CASE("illumination: leads that touch or overlap are one") {
    const auto leads = [](Nanoseconds second_start) {
        IlluminationBench bench;
        bench.light.plan(1, second_start, ms, true, ms);
        bench.light.plan(0, 10 * ms, ms, true, ms);
        bench.run(15 * ms);
        return bench.lead();
    };
    CHECK(leads(10 * ms) == Times{9'900 * us, 10'050 * us});
    CHECK(leads(10'150 * us) == Times{9'900 * us, 10'200 * us});
    CHECK(leads(10'150 * us + 1) ==
          Times{9'900 * us, 10'050 * us, 10'050 * us + 1, 10'200 * us + 1});
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, false, ms);
    bench.light.plan(1, 11 * ms, ms, true, ms);
    bench.run(10 * ms);
    bench.light.plan(1, 16 * ms, ms, true, 10 * ms);  // while it is on
    bench.run(20 * ms);
    CHECK(bench.lead() == Times{9'900 * us, 14 * ms, 15'900 * us, 16'050 * us});
}

TEST_CASE("illumination: a lead that is over is not begun once more by the next plan") {
    for (const Nanoseconds planned : {10'050 * us - 1, 10'050 * us, 12 * ms}) {
        IlluminationBench bench;
        bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
        bench.run(10 * ms);
        bench.light.plan(1, 20 * ms, 4 * ms, true, planned);  // before it is polled again
        bench.run(30 * ms);
        const Times leads = bench.lead();
        CHECK(Times{leads.end() - 2, leads.end()} == Times{19'900 * us, 20'050 * us});
        CHECK(leads[1] == 10'050 * us);
        CHECK(leads.size() == 4);
    }
    // Its end was put off, since nobody polled: it ends at once.
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    bench.run(9 * ms);
    bench.light.plan(1, 20 * ms, 4 * ms, true, 13 * ms);
    bench.polled = 13 * ms;
    bench.run(30 * ms);
    CHECK(bench.lead() == Times{9'900 * us, 13 * ms, 19'900 * us, 20'050 * us});
}

TEST_CASE("illumination: it stays on for an exposure whose lead is on its way") {
    for (const Nanoseconds later : {0, 1}) {
        IlluminationBench bench;
        bench.light.plan(0, 10 * ms, ms, true, ms);
        bench.light.plan(1, 12'100 * us + later, ms, true, ms);
        bench.edge(10 * ms, 0, true);
        bench.edge(11 * ms, 0, false);
        bench.edge(12'100 * us, 1, true);
        bench.edge(13 * ms, 1, false);
        CHECK(bench.gate() == (later == 0 ? Times{9'900 * us, 13 * ms}
                                          : Times{9'900 * us, 11 * ms, 12 * ms + 1, 13 * ms}));
    }
}

TEST_CASE("illumination: exposures without a pause share one longest light") {
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, ms, true, ms);
    bench.edge(10 * ms, 0, true);
    bench.run(11 * ms);
    bench.light.edge(0, false);
    bench.light.plan(1, 11'100 * us, ms, true, 11 * ms);
    bench.light.plan(1, 60 * ms, ms, true, 11 * ms);
    bench.edge(11'100 * us, 1, true);
    bench.run(25 * ms);
    CHECK(bench.gate() == Times{9'900 * us, 19'900 * us});
}

TEST_CASE(
    "illumination: after an exposure that ended, it ends with the lead of one that is missing") {
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, ms, true, ms);
    bench.light.plan(1, 10'600 * us, ms, true, ms);
    bench.edge(10 * ms, 0, true);
    bench.edge(10'500 * us, 0, false);
    bench.run(20 * ms);
    CHECK(bench.gate() == Times{9'900 * us, 10'700 * us});
}

TEST_CASE("illumination: one that is refused leaves the others that wait as they are") {
    IlluminationBench bench(ms, 10'000);
    bench.light.plan(0, 10 * ms, ms, true, ms);
    bench.edge(10 * ms, 0, true);
    for (const Nanoseconds start : {12 * ms, 40 * ms, 60 * ms})
        bench.light.plan(0, start, ms, true, 10 * ms);
    bench.edge(15 * ms, 0, false);
    bench.run(70 * ms);
    CHECK(bench.reports.all == std::vector<Limited>{{output_light_gate, 10'900 * us, ms},
                                                    {output_light_gate, 11'900 * us, 0}});
    CHECK(bench.gate() ==
          Times{9'900 * us, 10'900 * us, 39'900 * us, 40'200 * us, 59'900 * us, 60'100 * us});
}

TEST_CASE("illumination: one that is refused brings back none that was forgotten") {
    IlluminationBench bench(ms, 10'000);
    for (const Nanoseconds start : {10 * ms, 40 * ms, 60 * ms})
        bench.light.plan(0, start, ms, true, ms);
    bench.edge(10 * ms, 0, true);
    bench.edge(15 * ms, 0, false);
    bench.light.stop(15 * ms);
    bench.reports.all.clear();
    bench.light.plan(0, 16 * ms, ms, true, 15 * ms);
    CHECK(bench.reports.all == std::vector<Limited>{{output_light_gate, 15'900 * us, 0}});
    bench.run(70 * ms);
    CHECK(bench.gate() == Times{9'900 * us, 10'900 * us});
}

TEST_CASE("illumination: eight exposures are planned, one more gets no light and is reported") {
    IlluminationBench bench;
    for (Nanoseconds n = 1; n <= 8; ++n) bench.light.plan(0, 20 * n * ms, ms, true, 0);
    CHECK(bench.reports.all.empty());
    bench.light.plan(1, 180 * ms, 2 * ms, true, 0);
    CHECK(bench.reports.all == std::vector<Limited>{{1, 180 * ms, 2 * ms}});
    bench.run(200 * ms);
    CHECK(bench.lead().size() == 16);
    CHECK(bench.gate().size() == 16);
}

TEST_CASE("illumination: stopped, it is dark, and what was planned is forgotten") {
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    bench.light.plan(1, 10'080 * us, 19 * ms, false, ms);
    bench.edge(10 * ms, 0, true);
    bench.light.stop(10'020 * us);
    bench.run(11 * ms);
    CHECK(bench.gate() == Times{9'900 * us, 10'020 * us});
    CHECK(bench.lead() == Times{9'900 * us, 10'020 * us});
    bench.light.plan(0, 20 * ms, 4 * ms, true, 11 * ms);
    CHECK(bench.light.next_wake(0) == 21'900 * us);
    bench.run(30 * ms);
    CHECK(bench.gate() == Times{9'900 * us, 10'020 * us, 19'900 * us, 21'900 * us});
    CHECK(bench.lead() == Times{9'900 * us, 10'020 * us, 19'900 * us, 20'050 * us});
}

TEST_CASE("illumination: stopped before it begins, it has spent nothing") {
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    bench.light.stop(8 * ms);
    bench.run(11 * ms);
    CHECK(bench.gate().empty());
    CHECK(bench.budget(20 * ms) == 10 * ms);
}

TEST_CASE("illumination: a new configuration earns no light") {
    const bool paused = GENERATE(false, true);
    const Nanoseconds longest = GENERATE(10 * ms, 3 * ms);
    IlluminationBench bench;
    bench.expose(0, 10 * ms, 14 * ms);
    if (paused) bench.light.configure({}, 24 * ms);
    bench.configuration.max_on_ns = static_cast<std::uint32_t>(longest);
    bench.light.configure(bench.configuration, 24 * ms);
    bench.configuration.duty_ppm = 50'000;
    bench.light.configure(bench.configuration, 24 * ms);
    // There were 7.31 ms.
    CHECK(bench.budget(34 * ms) == std::min(longest, 7'810 * us));
}

TEST_CASE("illumination: configured anew, it is dark at once") {
    const bool lit = GENERATE(true, false);
    IlluminationBench bench;
    bench.light.plan(0, 10 * ms, 4 * ms, true, ms);
    bench.edge(10 * ms, 0, true);
    bench.light.configure(lit ? bench.configuration : wire::IlluminationConfiguration{},
                          10'100 * us);
    bench.light.plan(0, 20 * ms, 4 * ms, true, 10'100 * us);
    bench.run(30 * ms);
    CHECK(bench.gate() == (lit ? Times{9'900 * us, 10'100 * us, 19'900 * us, 21'900 * us}
                               : Times{9'900 * us, 10'100 * us}));
}
