// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/recording.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "pairing_bench.hpp"

using namespace versavis;
using namespace versavis::pairing;

namespace {

template <class Item>
Item there_and_back(const Item& item) {
    const auto evidence = from_metadata(to_metadata(item));
    REQUIRE(evidence);
    REQUIRE(std::holds_alternative<Item>(*evidence));
    return std::get<Item>(*evidence);
}

Evidence there(const Evidence& evidence) {
    const auto read = from_metadata(to_metadata(evidence));
    REQUIRE(read);
    return *read;
}

}  // namespace

TEST_CASE("recording: evidence comes back from an item of the ring as it was") {
    Exposure exposure;
    exposure.trigger = 7;
    exposure.start = BoardTime{1'000};
    exposure.end_on_host = HostTime{2'000};
    exposure.kind = StampKind::trigger_edge;
    exposure.exposed = false;
    exposure.recorded = HostTime{3'000};
    const Exposure same = there_and_back(exposure);
    CHECK(same.trigger == 7);
    CHECK(same.start == exposure.start);
    CHECK(same.end_on_host == exposure.end_on_host);
    CHECK(same.kind == StampKind::trigger_edge);
    CHECK_FALSE(same.exposed);
    CHECK(same.recorded == exposure.recorded);

    Arrival arrival;
    arrival.block_id = 65'536;
    arrival.camera_time = CameraTime{99};
    arrival.size = 12;
    CHECK(there_and_back(arrival).block_id == 65'536);
    CHECK(there_and_back(arrival).camera_time.ns == 99);
    CHECK(there_and_back(arrival).size == 12);

    Limits limits;
    limits.period = milliseconds(7);
    limits.camera_clock = false;
    limits.stamped = Instant::end;
    CHECK(there_and_back(limits).period == milliseconds(7));
    CHECK(there_and_back(limits).stamped == Instant::end);
    CHECK_FALSE(there_and_back(limits).camera_clock);
    CHECK(there_and_back(Shortfall{5, EventReason::no_buffer}).reason == EventReason::no_buffer);
    CHECK(there_and_back(StartRequest{Start::slow, HostTime{4}}).start == Start::slow);
    CHECK_FALSE(there_and_back(Reset{}).records_too);
    CHECK(there_and_back(Reset{true}).records_too);

    RecordLimits of_records;
    of_records.latency = microseconds(30);
    of_records.grid_slew_ppm = 2.5;
    of_records.wired = false;
    of_records.slave = true;
    CHECK(there_and_back(of_records).latency == microseconds(30));
    CHECK(there_and_back(of_records).grid_slew_ppm == 2.5);
    CHECK_FALSE(there_and_back(of_records).wired);
    CHECK(there_and_back(of_records).slave);
    ReceivedRecord received;
    received.record.flags = wire::exposure_late;
    received.record.end_ns = 5;
    received.commanded = milliseconds(3);
    received.exchanges = 17;
    received.expected_ns = 6;
    received.arrival = EventReason::too_old;
    received.clock_contradicted = true;
    received.grid_ns = 8;
    CHECK(there_and_back(received).grid_ns == 8);
    CHECK(there_and_back(received).record.flags == wire::exposure_late);
    CHECK(there_and_back(received).record.end_ns == 5);
    CHECK(there_and_back(received).commanded == milliseconds(3));
    CHECK(there_and_back(received).exchanges == 17);
    CHECK(there_and_back(received).expected_ns == 6);
    CHECK(there_and_back(received).arrival == EventReason::too_old);
    CHECK(there_and_back(received).clock_contradicted);
    CHECK(there_and_back(TriggersSkipped{4}).count == 4);
}

TEST_CASE("recording: layout by the document, and kinds that nobody knows") {
    Exposure exposure;
    exposure.trigger = 0x1122334455667788;
    const EvidenceMetadata metadata = to_metadata(exposure);
    CHECK(metadata.kind == 2);
    CHECK(metadata.words[0] == 0x1122334455667788);
    CHECK(to_metadata(Reset{}).kind == 6);
    EvidenceMetadata unknown = metadata;
    unknown.kind = GENERATE(0U, 11U, 0xFFFFFFFFU);
    CHECK_FALSE(from_metadata(unknown));
}

TEST_CASE("recording: an older one, whose resets say nothing of records, forgets none") {
    EvidenceMetadata reset{};
    reset.kind = 6;
    const auto read = from_metadata(reset);
    REQUIRE(read);
    CHECK_FALSE(std::get<Reset>(*read).records_too);
}

TEST_CASE("recording: what is recorded makes another pairing decide the same") {
    test::Bench live;
    test::Bench replayed;
    const auto both = [&](const Evidence& evidence) {
        pairing::apply(live.pairing, evidence);
        pairing::apply(replayed.pairing, there(evidence));
    };
    both(StartRequest{Start::slow, HostTime{}});
    for (int i = 0; i < 3; ++i) {
        const Exposure one = live.next(20);
        both(one);
        both(live.frame(live.next_id++, one));
    }
    CHECK(replayed.pairing.state() == State::locked);
    CHECK(replayed.pairing.wanted_start(HostTime{}) == Start::steady);
    live.next_id += 1;
    both(Shortfall{4, EventReason::no_buffer});
    const Exposure lost = live.next(20);
    both(lost);
    both(Advance{lost.end_on_host + seconds(5)});
    REQUIRE(replayed.decided.pulses.size() == 1);
    CHECK(replayed.decided.pulses[0].reason == EventReason::no_buffer);
    both(Reset{});
    CHECK(replayed.pairing.state() == State::searching);
    CHECK(replayed.decided.pairs == live.decided.pairs);
    CHECK(replayed.decided.pulses == live.decided.pulses);
}

TEST_CASE("recording: a replay leaves out the exposure of an implausible record") {
    const bool judged = GENERATE(true, false);
    test::Decisions decided;
    Replay replay(decided);
    const test::Bench bench;
    CHECK_FALSE(replay.begun());
    replay.apply(test::Bench::exposure(9, 9));  // before the beginning
    if (judged) replay.apply(RecordLimits{});
    replay.apply(Limits{});
    CHECK(replay.begun());
    CHECK((replay.record_verdict() != nullptr) == judged);
    for (const std::uint64_t trigger : {1U, 2U}) {
        const Exposure exposure = test::Bench::exposure(trigger, trigger);
        ReceivedRecord received;
        received.record.trigger = received.record.tick = trigger;
        received.record.trigger_ns = received.record.start_ns = exposure.start.ns;
        received.record.end_ns = exposure.end.ns;
        received.record.flags = trigger == 1 ? wire::exposure_measured : wire::exposure_no_end;
        replay.apply(received);
        if (judged) CHECK(replay.record_verdict()->doubt.has_value() == (trigger == 2));
        replay.apply(exposure);
    }
    replay.finish();
    REQUIRE(decided.pulses.size() == (judged ? 1 : 2));
    CHECK(decided.pulses[0].trigger == 1);
}

TEST_CASE("recording: what no service can have recorded is refused with its name") {
    const auto field = [](const Evidence& evidence) {
        const auto read = from_metadata(to_metadata(evidence));
        REQUIRE_FALSE(read);
        const std::string text = read.error().message();
        return text.substr(text.find('\'') + 1, text.rfind('\'') - text.find('\'') - 1);
    };
    const auto with = [](auto item, auto change) {
        REQUIRE(from_metadata(to_metadata(item)));
        change(item);
        return Evidence(item);
    };
    constexpr std::int64_t lowest = std::numeric_limits<std::int64_t>::min();
    for (const Duration period : {Duration{}, -nanoseconds(1), Duration{lowest}, seconds(86'401)}) {
        CHECK(field(with(Limits{}, [&](auto& l) { l.period = period; })) == "period_ns");
        CHECK(field(with(RecordLimits{}, [&](auto& l) { l.period = period; })) == "period_ns");
    }
    for (const Duration wait : {-nanoseconds(1), Duration{lowest}, seconds(86'401)}) {
        CHECK(field(with(Limits{}, [&](auto& l) { l.latest_arrival = wait; })) ==
              "latest_arrival_ns");
        CHECK(field(with(Limits{}, [&](auto& l) { l.exposure_wait = wait; })) ==
              "exposure_wait_ns");
        CHECK(field(with(Limits{}, [&](auto& l) { l.pattern_duration = wait; })) ==
              "pattern_duration_ns");
        CHECK(field(with(RecordLimits{}, [&](auto& l) { l.latency = wait; })) == "latency_ns");
        CHECK(field(with(RecordLimits{}, [&](auto& l) { l.exposure = wait; })) == "exposure_ns");
        CHECK(field(with(RecordLimits{}, [&](auto& l) { l.max_exposure = wait; })) ==
              "max_exposure_ns");
        CHECK(field(with(ReceivedRecord{}, [&](auto& r) { r.commanded = wait; })) ==
              "commanded_ns");
    }
    for (const Duration early : {Duration{lowest}, seconds(86'401)})
        CHECK(field(with(Limits{}, [&](auto& l) { l.earliest_arrival = early; })) ==
              "earliest_arrival_ns");
    CHECK(field(with(Limits{}, [](auto& l) { l.frames_held = 60'001; })) == "frames_held");
    for (const auto instant : {Instant::arrival, static_cast<Instant>(50'050'000)})
        CHECK(field(with(Limits{}, [&](auto& l) { l.stamped = instant; })) == "stamp_instant");
    for (const double slew : {-1.0, 1e7, std::nan("")})
        CHECK(field(with(RecordLimits{}, [&](auto& l) { l.grid_slew_ppm = slew; })) ==
              "grid_slew_ppm");
    for (const std::int64_t ns : {lowest, std::int64_t{1} << 61U, -(std::int64_t{1} << 61U)}) {
        CHECK(field(with(Exposure{}, [&](auto& e) { e.start.ns = ns; })) == "start_ns");
        CHECK(field(with(Exposure{}, [&](auto& e) { e.end.ns = ns; })) == "end_ns");
        CHECK(field(with(Exposure{}, [&](auto& e) { e.end_on_host.ns = ns; })) == "end_on_host_ns");
        CHECK(field(with(Exposure{}, [&](auto& e) { e.earliest_on_host.ns = ns; })) ==
              "earliest_on_host_ns");
        CHECK(field(with(Exposure{}, [&](auto& e) { e.recorded.ns = ns; })) == "recorded_ns");
        CHECK(field(with(Arrival{}, [&](auto& a) { a.camera_time.ns = ns; })) == "camera_time_ns");
        CHECK(field(with(Arrival{}, [&](auto& a) { a.arrived.ns = ns; })) == "arrived_ns");
        CHECK(field(with(Arrival{}, [&](auto& a) { a.exposure.ns = ns; })) == "exposure_ns");
        CHECK(field(with(Advance{}, [&](auto& a) { a.now.ns = ns; })) == "now_ns");
        CHECK(field(with(StartRequest{}, [&](auto& r) { r.now.ns = ns; })) == "now_ns");
        CHECK(field(with(ReceivedRecord{}, [&](auto& r) { r.record.trigger_ns = ns; })) ==
              "trigger_ns");
    }
    ReceivedRecord unknown;
    unknown.record.start_ns = unknown.record.end_ns = wire::no_time;
    CHECK(from_metadata(to_metadata(unknown)));
    for (const std::int64_t ns : {std::int64_t{1} << 61U, -(std::int64_t{1} << 61U)}) {
        CHECK(field(with(unknown, [&](auto& r) { r.record.start_ns = ns; })) == "start_ns");
        CHECK(field(with(unknown, [&](auto& r) { r.record.end_ns = ns; })) == "end_ns");
    }
}
