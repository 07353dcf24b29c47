// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/ptp_frames.hpp"

#include <catch2/catch.hpp>
#include <map>
#include <random>

#include "camera/action_trigger.hpp"

using namespace versavis;
using namespace versavis::daemon;
using clock::Agreement;

namespace {

constexpr Duration host_behind = seconds(1'795'983'837);  ///< of PTP's time
constexpr std::size_t held = 9;

CameraConfiguration camera_of(double rate_hz = 20) {
    CameraConfiguration camera;
    camera.trigger = TriggerSource::ptp;
    camera.rate_hz = rate_hz;
    camera.exposure_us = 3000;
    camera.max_exposure_us = 20'000;
    camera.latest_arrival_ms = 500;
    camera.stamp_instant = pairing::Instant::start;
    return camera;
}

CameraTime on_ptp(HostTime host) { return CameraTime{host.ns} + host_behind; }

clock::HostEstimate on_host(CameraTime ptp) {
    return {HostTime{ptp.ns} - host_behind, microseconds(10), microseconds(50), {}, {}};
}

clock::ClockReading reading_at(HostTime host) {
    return {host - microseconds(50), on_ptp(host), host + microseconds(50)};
}

/// One camera and what is fed of it.
struct PtpCamera {
    explicit PtpCamera(const CameraConfiguration& camera = camera_of()) : frames(camera, held) {
        frames.set_exposure(milliseconds(3), {});
        frames.read_clock(reading_at(now), Agreement::agrees);
    }

    PtpTrigger trigger() {
        const PtpTrigger next = frames.next(on_ptp(now));
        now = HostTime{(next.at - host_behind).ns} - milliseconds(20);
        frames.sent(next, HostTime{(next.at - host_behind).ns});
        return next;
    }

    /// The frame of an exposure that began `late` after the trigger, with a stamp `off` that.
    void frame(const PtpTrigger& trigger, Duration late = microseconds(30), Duration off = {},
               Duration on_its_way = milliseconds(5)) {
        const CameraTime start = trigger.at + late;
        pairing::Arrival arrival;
        arrival.block_id = ++block_id;
        arrival.camera_time = start + off;
        arrival.arrived = HostTime{(start - host_behind).ns} + milliseconds(3) + on_its_way;
        now = std::max(now, arrival.arrived);
        frames.add(arrival, {}, on_host(arrival.camera_time));
    }

    void read(Agreement agreement = Agreement::agrees) {
        now = now + milliseconds(1);
        frames.read_clock(reading_at(now), agreement);
    }

    EventReason verdict() {
        const auto verdicts = frames.take_verdicts();
        REQUIRE(verdicts.size() == 1);
        return verdicts[0].reason;
    }

    PtpFrames frames;
    HostTime now{5'000'000'000};
    std::uint64_t block_id = 0;
};

}  // namespace

TEST_CASE("ptp_frames: triggers come half an exposure before the points of the grid, in order") {
    PtpCamera bench;
    std::uint64_t number = 0;
    CameraTime before;
    for (int i = 0; i < 100; ++i) {
        const PtpTrigger trigger = bench.trigger();
        CHECK(trigger.number == ++number);
        CHECK((trigger.at + microseconds(1500)).ns % 50'000'000 == 0);
        CHECK(trigger.tick == static_cast<std::uint64_t>(trigger.at.ns + 1'500'000) / 1000);
        if (i > 0) CHECK(trigger.at - before == milliseconds(50));
        before = trigger.at;
        bench.frame(trigger, {});
        bench.read();
    }
}

TEST_CASE("ptp_frames: a camera's latency is learned, so that its middles meet the grid") {
    PtpCamera bench;
    PtpTrigger trigger;
    for (int i = 0; i < 40; ++i) {
        trigger = bench.trigger();
        bench.frame(trigger, microseconds(80));
        bench.read();
    }
    CHECK(absolute(Duration{(trigger.at + microseconds(80 + 1500)).ns % 50'000'000}) <
          microseconds(1));
}

TEST_CASE("ptp_frames: a frame is proved by the next reading of the clock, and not before") {
    PtpCamera bench;
    const PtpTrigger trigger = bench.trigger();
    bench.frame(trigger);
    CHECK(bench.frames.take_verdicts().empty());
    CHECK(bench.frames.waiting());
    bench.read(Agreement::unknown);
    CHECK(bench.frames.waiting());
    bench.read();
    const auto verdicts = bench.frames.take_verdicts();
    REQUIRE(verdicts.size() == 1);
    REQUIRE(verdicts[0].exposure);
    CHECK(verdicts[0].exposure->trigger == trigger.number);
    CHECK(verdicts[0].exposure->tick == trigger.tick);
    CHECK(verdicts[0].exposure->middle() == trigger.at + microseconds(30 + 1500));
    CHECK(verdicts[0].exposure->length_known);
    CHECK(verdicts[0].exposure->middle_sigma.ns == 0);
}

TEST_CASE("ptp_frames: what a reading that took long cannot tell is in sigma") {
    for (const Duration width : {microseconds(200), microseconds(1600)}) {
        PtpCamera bench;
        bench.frame(bench.trigger());
        clock::ClockReading reading = reading_at(bench.now);
        reading.before = bench.now - width / 2;
        reading.after = bench.now + width / 2;
        bench.frames.read_clock(reading, Agreement::agrees);
        const auto verdicts = bench.frames.take_verdicts();
        REQUIRE(verdicts.size() == 1);
        const Duration sigma = width > microseconds(200) ? width / 2 : Duration{};
        CHECK(verdicts[0].exposure->middle_sigma == sigma);
        CHECK(verdicts[0].exposure->start_sigma == sigma);
    }
}

TEST_CASE("ptp_frames: no frame is proved by a reading from before its end") {
    PtpCamera bench;
    const PtpTrigger trigger = bench.trigger();
    bench.frame(trigger);
    bench.frames.read_clock(reading_at(HostTime{(trigger.at - host_behind).ns} + milliseconds(2)),
                            Agreement::agrees);
    CHECK(bench.frames.waiting());
}

TEST_CASE("ptp_frames: what waits is refused where the clock departs, and what began before") {
    PtpCamera bench;
    const PtpTrigger first = bench.trigger();
    bench.frame(first);
    bench.read(Agreement::differs);
    CHECK(bench.verdict() == EventReason::no_clock);
    const PtpTrigger second = bench.trigger();
    bench.frame(second);
    CHECK(bench.verdict() == EventReason::no_clock);
    const PtpTrigger third = bench.trigger();
    bench.now = HostTime{(third.at - host_behind).ns} + milliseconds(1);
    bench.read();  // while it exposes
    bench.frame(third);
    CHECK(bench.verdict() == EventReason::no_clock);
    const PtpTrigger fourth = bench.trigger();
    bench.frame(fourth);
    bench.read();
    CHECK(bench.verdict() == EventReason::none);
}

TEST_CASE("ptp_frames: where PTP's time goes back, triggers go on from there") {
    PtpCamera bench;
    bench.frame(bench.trigger());
    bench.read();
    bench.read(Agreement::differs);
    const CameraTime back{1'000'000'000'000};
    const PtpTrigger next = bench.frames.next(back);
    CHECK(next.at > back);
    CHECK(next.at - back < seconds(1));
}

TEST_CASE("ptp_frames: stamps that no trigger makes are refused, and by how much they are off") {
    PtpCamera bench;
    bench.frame(bench.trigger(), microseconds(250));
    CHECK(bench.verdict() == EventReason::mismatch);
    CHECK(bench.frames.start_delay() == microseconds(250));
    bench.frame(bench.trigger(), {}, milliseconds(3));
    CHECK(bench.verdict() == EventReason::mismatch);
    CHECK(bench.frames.start_delay() == milliseconds(3));
    bench.frame(bench.trigger(), {}, seconds(-37));
    CHECK(bench.verdict() == EventReason::mismatch);
    CHECK(absolute(bench.frames.start_delay() + seconds(37)) < milliseconds(100));
}

TEST_CASE("ptp_frames: one trigger has one frame, and a stale stamp does not take another's") {
    PtpCamera bench;
    const PtpTrigger first = bench.trigger();
    bench.frame(first);
    bench.frame(first);
    bench.read();
    const auto verdicts = bench.frames.take_verdicts();
    REQUIRE(verdicts.size() == 2);
    CHECK(verdicts[0].reason == EventReason::out_of_order);
    CHECK(verdicts[1].reason == EventReason::none);
    bench.frame(bench.trigger());
    bench.read();
    CHECK(bench.verdict() == EventReason::none);
    const PtpTrigger lost = bench.trigger();
    ++bench.block_id;  // its frame is lost
    bench.trigger();
    bench.frame(lost, microseconds(30), {}, milliseconds(55));  // the next, with its stamp
    CHECK(bench.verdict() == EventReason::mismatch);
}

TEST_CASE("ptp_frames: a camera that counts one frame more and is later for good is proved again") {
    PtpCamera bench;
    for (int i = 0; i < 5; ++i) {
        bench.frame(bench.trigger());
        bench.read();
        REQUIRE(bench.verdict() == EventReason::none);
    }
    ++bench.block_id;
    const auto later = [&] {
        bench.frame(bench.trigger(), microseconds(30), {}, milliseconds(35));
        bench.read();
        return bench.verdict();
    };
    for (int i = 0; i < 3; ++i) CHECK(later() == EventReason::mismatch);
    for (int i = 0; i < 5; ++i) CHECK(later() == EventReason::none);
}

TEST_CASE("ptp_frames: the arrival bounds the exposure") {
    PtpCamera bench;
    const PtpTrigger trigger = bench.trigger();
    pairing::Arrival arrival;
    arrival.camera_time = trigger.at;
    const HostTime start{(trigger.at - host_behind).ns};
    SECTION("before its end") {
        arrival.arrived = start + milliseconds(1);
        bench.frames.add(arrival, {}, on_host(arrival.camera_time));
        CHECK(bench.verdict() == EventReason::not_yet);
    }
    SECTION("long after it") {
        arrival.arrived = start + milliseconds(600);
        bench.frames.add(arrival, {}, on_host(arrival.camera_time));
        CHECK(bench.verdict() == EventReason::too_old);
    }
    SECTION("while PTP's time is unknown") {
        arrival.arrived = start + milliseconds(8);
        bench.frames.add(arrival, {}, std::nullopt);
        CHECK(bench.verdict() == EventReason::no_clock);
    }
}

TEST_CASE("ptp_frames: what is not known of instant and length is in sigma") {
    CameraConfiguration camera = camera_of();
    camera.stamp_instant = pairing::Instant::unknown;
    PtpCamera bench(camera);
    const auto sigma_of = [&](Duration late, Duration length) {
        const PtpTrigger trigger = bench.trigger();
        pairing::Arrival arrival;
        arrival.block_id = ++bench.block_id;
        arrival.camera_time = trigger.at + late;
        arrival.arrived = HostTime{(arrival.camera_time - host_behind).ns} + milliseconds(30);
        bench.now = arrival.arrived;
        bench.frames.add(arrival, {{}, length}, on_host(arrival.camera_time));
        bench.read();
        const auto verdicts = bench.frames.take_verdicts();
        REQUIRE(verdicts.size() == 1);
        REQUIRE(verdicts[0].exposure);
        return verdicts[0].exposure->middle_sigma;
    };
    const Duration before = milliseconds(3);
    const Duration after = milliseconds(5);
    CHECK(sigma_of(microseconds(40), before) == microseconds(40));
    CHECK(sigma_of({}, before).ns == 0);
    bench.frames.set_exposure(after, bench.now);
    CHECK(sigma_of({}, before) == milliseconds(1));  // the data may be of the frame before
    bench.now = bench.now + seconds(1);
    CHECK(sigma_of({}, after).ns == 0);
    CHECK(sigma_of({}, {}).ns == 0);  // as it was set
    bench.frames.set_exposure({}, bench.now);
    bench.frames.read_exposure(after, bench.now);
    CHECK(sigma_of({}, {}) == milliseconds(10));  // half of the longest there may be
}

TEST_CASE("ptp_frames: a varying length that frames carry is sure only after the next frame") {
    PtpCamera bench;
    bench.frames.set_exposure({}, bench.now);
    const auto add = [&](Duration length, Duration event = {}) {
        const PtpTrigger trigger = bench.trigger();
        pairing::Arrival arrival;
        arrival.block_id = ++bench.block_id;
        arrival.camera_time = trigger.at;
        arrival.arrived = HostTime{(trigger.at - host_behind).ns} + milliseconds(30);
        bench.now = std::max(bench.now, arrival.arrived);
        bench.frames.add(arrival, {event, length}, on_host(arrival.camera_time));
        bench.read();
        return bench.frames.take_verdicts();
    };
    CHECK(add(milliseconds(1)).empty());
    auto verdicts = add(milliseconds(1));
    REQUIRE(verdicts.size() == 1);
    CHECK(verdicts[0].exposure->middle_sigma.ns == 0);
    verdicts = add(milliseconds(5));  // the one before may have been as long
    REQUIRE(verdicts.size() == 1);
    CHECK(verdicts[0].exposure->middle_sigma == milliseconds(2));
    ++bench.block_id;  // lost, and with it what it would have said
    verdicts = add(milliseconds(5));
    REQUIRE(verdicts.size() == 1);
    CHECK(verdicts[0].exposure->middle_sigma == milliseconds(10));
    verdicts = add(milliseconds(4), milliseconds(6));  // events are of this exposure
    REQUIRE(verdicts.size() == 2);
    CHECK(verdicts[1].exposure->length == milliseconds(6));
    CHECK(verdicts[1].exposure->middle_sigma.ns == 0);
}

TEST_CASE("ptp_frames: a length that was never set is refused") {
    PtpCamera bench;
    for (const Duration wrong : {milliseconds(4), milliseconds(-1), seconds(3), Duration{3000}}) {
        const PtpTrigger trigger = bench.trigger();
        pairing::Arrival arrival;
        arrival.camera_time = trigger.at;
        arrival.arrived = HostTime{(trigger.at - host_behind).ns} + milliseconds(30);
        bench.now = arrival.arrived;
        bench.frames.add(arrival, {{}, wrong}, on_host(arrival.camera_time));
        CHECK(bench.verdict() == EventReason::wrong_exposure);
    }
}

TEST_CASE("ptp_frames: other values give back what waits, and count on") {
    PtpCamera bench;
    const PtpTrigger trigger = bench.trigger();
    bench.frame(trigger);
    bench.frames.reconfigure(camera_of(40));
    CHECK(bench.verdict() == EventReason::reset);
    const PtpTrigger next = bench.trigger();
    CHECK(next.number == trigger.number + 1);
    bench.frame(next);
    bench.read();
    CHECK(bench.verdict() == EventReason::none);
}

TEST_CASE("ptp_frames: other instants than the start are taken off") {
    for (const auto instant : {pairing::Instant::middle, pairing::Instant::end}) {
        CameraConfiguration camera = camera_of();
        camera.stamp_instant = instant;
        PtpCamera bench(camera);
        const PtpTrigger trigger = bench.trigger();
        bench.frame(trigger, {}, milliseconds(3) / (instant == pairing::Instant::end ? 1 : 2));
        bench.read();
        const auto verdicts = bench.frames.take_verdicts();
        REQUIRE(verdicts.size() == 1);
        REQUIRE(verdicts[0].exposure);
        CHECK(verdicts[0].exposure->middle() == trigger.at + microseconds(1500));
    }
}

TEST_CASE("ptp_frames: waiting is bounded, in time and in number") {
    PtpCamera bench;
    for (std::size_t i = 0; i < held + 3; ++i) bench.frame(bench.trigger());
    const auto full = bench.frames.take_verdicts();
    REQUIRE(full.size() == 3);
    CHECK(full[0].reason == EventReason::no_buffer);
    bench.frames.advance(bench.now + seconds(2));
    const auto late = bench.frames.take_verdicts();
    CHECK(late.size() == held);
    CHECK(late[0].reason == EventReason::no_clock);
    CHECK(bench.frames.take_missed().empty());
    const PtpTrigger unanswered = bench.trigger();
    bench.frames.advance(bench.now + seconds(2));
    const auto missed = bench.frames.take_missed();
    REQUIRE(missed.size() == 1);
    CHECK(missed[0].number == unanswered.number);
}

/// A camera that loses triggers and frames, whose clock steps, whose stamps are stale, of another
/// exposure or another clock, and readings that are late or tell nothing.
TEST_CASE("ptp_frames: no lie of a camera is proved") {
    std::size_t proved = 0;
    for (std::uint64_t seed = 1; seed <= 300; ++seed) {
        std::mt19937_64 random(seed);
        const auto chance = [&](unsigned one_in) { return random() % one_in == 0; };
        PtpCamera bench;
        std::map<std::uint64_t, CameraTime> middles;  // by block id, in PTP's true time
        Duration off;                                 // of the camera's clock
        CameraTime last_stamp;
        for (int i = 0; i < 200; ++i) {
            const PtpTrigger trigger = bench.trigger();
            if (chance(15)) continue;  // the command is lost
            bench.frames.acknowledged(trigger.number);
            // A clock that steps and steps back between two readings is not caught.
            if (!bench.frames.waiting() && chance(40))
                off = chance(2) ? Duration{} : milliseconds(std::int64_t(random() % 9));
            const CameraTime start = trigger.at + microseconds(20 + std::int64_t(random() % 20));
            middles[++bench.block_id] = start - off + microseconds(1500);
            const CameraTime stamp = chance(30)   ? last_stamp
                                     : chance(50) ? start - seconds(37)
                                     : chance(50) ? start + milliseconds(50)
                                                  : start;
            last_stamp = start;
            if (chance(12)) continue;  // the frame is lost
            pairing::Arrival arrival;
            arrival.block_id = bench.block_id;
            arrival.camera_time = stamp;
            arrival.arrived = HostTime{(start - off - host_behind).ns} + milliseconds(8);
            bench.now = std::max(bench.now, arrival.arrived);
            bench.frames.add(arrival, {}, on_host(stamp));
            if (chance(3)) continue;
            bench.read(chance(6)                 ? Agreement::unknown
                       : off > microseconds(500) ? Agreement::differs
                                                 : Agreement::agrees);
            for (const PtpVerdict& verdict : bench.frames.take_verdicts()) {
                if (!verdict.exposure) continue;
                ++proved;
                INFO(seed);
                REQUIRE(absolute(verdict.exposure->middle() -
                                 middles.at(verdict.arrival.block_id)) < microseconds(500));
            }
            bench.frames.advance(bench.now);
        }
    }
    CHECK(proved > 20'000);
}

TEST_CASE("action_trigger: a scheduled action, byte by byte, and its acknowledge") {
    const auto packet = scheduled_action({0x0123456789ABCDEF}, 0x1234);
    const std::vector<std::uint8_t> expected{
        0x42, 0x81, 0x01, 0x00, 0x00, 0x14, 0x12, 0x34, 'V',  'E',  'R',  'S',  'A',  'V',
        'I',  'S',  0x00, 0x00, 0x00, 0x01, 0x01, 0x23, 0x45, 0x67, 0x89, 0xAB, 0xCD, 0xEF};
    CHECK(packet == expected);
    const std::vector<std::uint8_t> late{0x80, 0x16, 0x01, 0x01, 0, 0, 0x12, 0x34};
    CHECK(action_status(late, 0x1234) == 0x8016);
    CHECK_FALSE(action_status(late, 0x1235));
    CHECK_FALSE(action_status({late.data(), 7}, 0x1234));
    const std::vector<std::uint8_t> another{0x80, 0x16, 0x00, 0x81, 0, 0, 0x12, 0x34};
    CHECK_FALSE(action_status(another, 0x1234));
}
