// SPDX-License-Identifier: BSD-3-Clause
#include "plausibility/exposure_check.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr HostTime first_exposure{100'000'000'000};
constexpr Duration exposure_period = milliseconds(50);

CameraConfiguration checked_camera(bool check = true) {
    CameraConfiguration configuration;
    configuration.rate_hz = 20;
    configuration.check_exposure = check;
    return configuration;
}

struct ExposureBench {
    explicit ExposureBench(bool checks = true) : check(checked_camera(checks)) {
        check.set_line_delays({});
    }

    /// The next frame, of an exposure that measures `length`; `chunk`: by its own data.
    ExposureVerdict frame(Duration length, Duration chunk = {}) {
        pairing::Exposure exposure;
        exposure.end = exposure.start + length;
        exposure.earliest_on_host = now = now + exposure_period;
        pairing::Arrival arrival;
        arrival.block_id = ++block_id;
        return check.judge(
            arrival,
            source == ExposureSource::event ? FrameAccount{{}, chunk} : FrameAccount{chunk, {}},
            exposure, microseconds(20));
    }

    /// The same, of one that no line shows.
    Duration unseen(Duration chunk, Duration event) {
        const ExposureVerdict verdict = unseen_verdict(chunk, event);
        return verdict.confirmed ? verdict.length : Duration{};
    }
    ExposureVerdict unseen_verdict(Duration chunk, Duration event) {
        pairing::Exposure exposure;
        exposure.kind = StampKind::trigger_edge;
        exposure.earliest_on_host = now = now + exposure_period;
        pairing::Arrival arrival;
        arrival.block_id = ++block_id;
        return check.judge(arrival, {chunk, event}, exposure, {});
    }

    bool contradicts(Duration length, Duration chunk = {}) {
        return frame(length, chunk).contradicted;
    }

    Duration sigma(Duration length, Duration chunk = {}) {
        return frame(length, chunk).correction.sigma;
    }

    ExposureCheck check;
    ExposureSource source = ExposureSource::chunk;  ///< of what `chunk` says
    HostTime now = first_exposure;
    std::uint64_t block_id = 0;
};

}  // namespace

TEST_CASE("exposure_check: a length is held to what is known of the line, whatever it lasts") {
    ExposureBench bench;
    bench.check.set_camera_exposure(milliseconds(19), {});
    CHECK_FALSE(bench.contradicts(microseconds(19060)));
    CHECK(bench.contradicts(microseconds(19200)));
    CHECK(bench.check.contradicted());
    CHECK(bench.check.measured() == microseconds(19200));
    CHECK(bench.check.reported() == milliseconds(19));
    CHECK(bench.check.source() == ExposureSource::setting);
    for (int i = 0; i < 100; ++i) CHECK_FALSE(bench.contradicts(microseconds(19003)));
    CHECK(bench.contradicts(microseconds(19025)));
    CHECK(bench.contradicts(microseconds(18980)));
}

TEST_CASE("exposure_check: while a setting settles, both lengths pass, and sigma says so") {
    ExposureBench bench;
    bench.check.set_camera_exposure(milliseconds(2), {});
    for (int i = 0; i < 40; ++i) bench.frame(milliseconds(2));
    CHECK(bench.check.reported_at(bench.now) == milliseconds(2));
    bench.check.set_camera_exposure(milliseconds(3), bench.now);
    const ExposureVerdict old = bench.frame(milliseconds(2));
    CHECK_FALSE(old.contradicted);
    CHECK(old.correction.sigma >= microseconds(250));
    CHECK_FALSE(bench.contradicts(milliseconds(3)));
    CHECK(bench.contradicts(microseconds(3100)));
    CHECK(bench.check.reported_at(bench.now).ns == 0);
    // Half a second and five periods of 50 ms.
    bench.now = bench.now + milliseconds(750);
    CHECK(bench.check.reported_at(bench.now) == milliseconds(3));
    CHECK(bench.contradicts(milliseconds(2)));
    CHECK(bench.sigma(milliseconds(3)) < microseconds(10));
}

TEST_CASE("exposure_check: a frame's own data are tight at once, after any change") {
    ExposureBench bench;
    for (int i = 0; i < 200; ++i) {
        const Duration length = microseconds(2000 + i * 377 % 5000);
        CHECK_FALSE(bench.contradicts(length + microseconds(i % 3), length));
    }
    CHECK(bench.check.source() == ExposureSource::chunk);
    CHECK_FALSE(bench.check.wants_readings());
    CHECK(bench.contradicts(microseconds(20030), milliseconds(20)));
    CHECK(bench.sigma(milliseconds(3), milliseconds(3)) < microseconds(5));
}

TEST_CASE("exposure_check: the camera's events are as good as data of the frame") {
    ExposureBench bench;
    bench.source = ExposureSource::event;
    for (int i = 0; i < 100; ++i)
        CHECK_FALSE(bench.contradicts(microseconds(2000 + i * 10), microseconds(2000 + i * 10)));
    CHECK(bench.check.source() == ExposureSource::event);
    CHECK_FALSE(bench.check.wants_readings());
    CHECK(bench.contradicts(microseconds(3020), microseconds(3000)));
}

TEST_CASE(
    "exposure_check: without a line, events show the length if the camera agrees with itself") {
    ExposureBench bench;
    CHECK(bench.unseen({}, milliseconds(3)).ns == 0);  // nothing else is known
    CHECK(bench.unseen(milliseconds(3), {}).ns == 0);  // it may be of the frame before
    CHECK(bench.unseen(milliseconds(3), microseconds(3050)) == microseconds(3050));
    CHECK(bench.check.source() == ExposureSource::event);
    CHECK(bench.check.reported() == microseconds(3050));
    CHECK(bench.unseen(milliseconds(3), microseconds(3070)).ns == 0);
    CHECK(bench.check.source() == ExposureSource::none);
    CHECK(bench.unseen(microseconds(40), microseconds(25)) == microseconds(25));

    bench.check.set_camera_exposure(milliseconds(3), {});
    CHECK(bench.unseen({}, microseconds(2950)) == microseconds(2950));
    CHECK(bench.unseen({}, microseconds(3100)).ns == 0);
    CHECK_FALSE(bench.check.wants_readings());

    bench.check.set_camera_exposure({}, bench.now);  // it varies
    CHECK(bench.check.wants_readings());
    bench.check.read_exposure(milliseconds(4), bench.now, {});
    bench.now = bench.now + seconds(2);
    bench.check.read_exposure(milliseconds(4), bench.now, {});
    bench.check.read_exposure(milliseconds(5), bench.now + milliseconds(200), {});
    CHECK(bench.unseen({}, microseconds(4500)) == microseconds(4500));
    CHECK(bench.unseen({}, microseconds(5200)).ns == 0);
    CHECK(bench.check.wants_readings());  // there is nothing better against events
}

TEST_CASE("exposure_check: without a line, one account of the camera is stated, not confirmed") {
    ExposureBench bench;
    const auto stated = [&](Duration chunk, Duration event) {
        const ExposureVerdict verdict = bench.unseen_verdict(chunk, event);
        CHECK_FALSE(verdict.confirmed);
        return verdict.length;
    };
    CHECK(stated({}, {}).ns == 0);
    CHECK(stated({}, milliseconds(3)) == milliseconds(3));
    CHECK(stated(milliseconds(4), {}) == milliseconds(4));
    bench.check.set_camera_exposure(milliseconds(2), {});
    CHECK(stated({}, {}) == milliseconds(2));
    CHECK(stated({}, milliseconds(3)) == milliseconds(2));
    CHECK(stated(milliseconds(4), {}) == milliseconds(4));
    bench.check.set_camera_exposure(milliseconds(6), bench.now);  // not yet of each frame
    CHECK(stated({}, {}) == milliseconds(4));
}

TEST_CASE("exposure_check: without a line, nothing is believed where checks are switched off") {
    ExposureBench bench(false);
    CHECK(bench.unseen(milliseconds(3), milliseconds(3)).ns == 0);
}

TEST_CASE("exposure_check: every second or third end that is late is withheld, and no other") {
    ExposureBench bench;
    const int every = GENERATE(2, 3);
    int withheld = 0;
    for (int i = 0; i < 300; ++i) {
        const Duration exposure = microseconds(3000 + i * 7);
        const bool lie = i % every == 0;
        const bool contradicted =
            bench.contradicts(exposure + microseconds(lie ? 300 + i * 131 % 700 : 0), exposure);
        CHECK(contradicted == lie);
        withheld += contradicted ? 1 : 0;
    }
    CHECK(withheld == 300 / every);
    CHECK(bench.check.source() == ExposureSource::chunk);
}

TEST_CASE("exposure_check: a slow falling edge costs eight frames, and is then taken off") {
    ExposureBench bench;
    for (int i = 0; i < 40; ++i) {
        const Duration exposure = microseconds(3000 + i * 100);
        const ExposureVerdict verdict = bench.frame(exposure + microseconds(400), exposure);
        CHECK(verdict.contradicted == (i < 8));
        if (i < 8) continue;
        CHECK(absolute(verdict.correction.middle() - microseconds(200)) <= microseconds(1));
        CHECK(verdict.correction.sigma < microseconds(20));
    }
    // Pairing gets what fits the line.
    CHECK(absolute(bench.check.for_pairing(milliseconds(3)) - microseconds(3400)) <=
          microseconds(1));
}

TEST_CASE("exposure_check: before the line is known, no account is good enough for pairing") {
    ExposureBench bench;
    CHECK(bench.check.for_pairing(milliseconds(3)).ns == 0);
    for (int i = 0; i < 8; ++i) bench.frame(milliseconds(3), milliseconds(3));
    CHECK(bench.check.for_pairing(milliseconds(3)) == milliseconds(3));
    CHECK(bench.check.for_pairing({}).ns == 0);
}

TEST_CASE("exposure_check: chunks of the frame before are found out, and used as such") {
    ExposureBench bench;
    Duration before = milliseconds(3);
    int withheld = 0;
    for (int i = 0; i < 60; ++i) {
        const Duration length = microseconds(3000 + i * 377 % 2000);
        const ExposureVerdict verdict = bench.frame(length, before);
        withheld += verdict.contradicted ? 1 : 0;
        // Of the newest length there is no confirmation yet: half of what it may be wrong by is
        // sigma.
        INFO(i << ": " << length.ns << " after " << before.ns);
        if (i > 10) CHECK((verdict.correction.sigma * 6).ns > (absolute(length - before) / 2).ns);
        before = length;
    }
    CHECK(bench.check.source() == ExposureSource::chunk_before);
    CHECK(withheld <= 6);
    CHECK(bench.check.for_pairing(milliseconds(3)).ns == 0);
    for (int i = 0; i < 30; ++i) bench.frame(milliseconds(3), milliseconds(3));
    CHECK(bench.sigma(milliseconds(3), milliseconds(3)) < microseconds(10));
}

TEST_CASE("exposure_check: what readings cannot confirm is in sigma") {
    ExposureBench bench;
    bench.check.set_camera_exposure({}, {});
    CHECK(bench.check.wants_readings());
    CHECK(bench.sigma(milliseconds(3)) >= microseconds(90));
    CHECK(bench.check.source() == ExposureSource::none);
    const auto read = [&](Duration exposure) {
        bench.check.read_exposure(exposure, bench.now, microseconds(20));
    };
    for (int i = 0; i < 20; ++i) {
        bench.frame(milliseconds(3));
        read(milliseconds(3));
    }
    CHECK(bench.sigma(milliseconds(3)) < microseconds(10));
    CHECK(bench.check.source() == ExposureSource::reading);
    // It may have changed since the reading, or its end may be wrong: nobody can know.
    const ExposureVerdict longer = bench.frame(microseconds(3800));
    CHECK_FALSE(longer.contradicted);
    CHECK(longer.correction.sigma >= microseconds(390));
    read(microseconds(3800));
    CHECK(bench.sigma(microseconds(3800)) >= microseconds(190));
    for (int i = 0; i < 20; ++i) {
        bench.frame(microseconds(3800));
        read(microseconds(3800));
    }
    CHECK(bench.sigma(microseconds(3800)) < microseconds(10));
}

TEST_CASE("exposure_check: readings show a slow edge, but only of an exposure that keeps still") {
    ExposureBench bench;
    bench.check.set_camera_exposure({}, {});
    for (int i = 0; i < 40; ++i) {
        const Duration exposure = microseconds(3000 + i * 50);
        bench.check.read_exposure(exposure, bench.now, microseconds(20));
        bench.frame(exposure + microseconds(400));
    }
    CHECK(bench.check.edges().correction.ns == 0);
    for (int i = 0; i < 40; ++i) {
        bench.check.read_exposure(milliseconds(5), bench.now, microseconds(20));
        bench.frame(microseconds(5400));
    }
    CHECK(absolute(bench.check.edges().correction - microseconds(200)) <= microseconds(1));
    CHECK(bench.sigma(microseconds(5400)) < microseconds(20));
}

TEST_CASE("exposure_check: an exposure that somebody changes is read, and no slow edge") {
    ExposureBench bench;
    bench.check.set_camera_exposure(milliseconds(2), {});
    for (int i = 0; i < 20; ++i) bench.frame(milliseconds(2));
    CHECK_FALSE(bench.check.wants_readings());
    int withheld = 0;
    for (int i = 0; i < 40; ++i) {
        if (bench.contradicts(microseconds(2500))) ++withheld;
        if (bench.check.wants_readings())
            bench.check.read_exposure(microseconds(2500), bench.now, microseconds(20));
    }
    CHECK(withheld == 1);
    CHECK(bench.check.edges().correction.ns == 0);
    CHECK(bench.check.reported_at(bench.now) == microseconds(2500));
}

TEST_CASE(
    "exposure_check: a slow edge of a fixed exposure is learned by readings that confirm it") {
    ExposureBench bench;
    bench.check.set_camera_exposure(milliseconds(2), {});
    for (int i = 0; i < 20; ++i) CHECK(bench.contradicts(microseconds(2400)));
    for (int i = 0; i < 8; ++i) {
        CHECK(bench.contradicts(microseconds(2400)));
        bench.check.read_exposure(milliseconds(2), bench.now, microseconds(20));
    }
    CHECK_FALSE(bench.contradicts(microseconds(2400)));
    CHECK(bench.check.edges().correction == microseconds(200));
}

TEST_CASE("exposure_check: where nothing is checked, sigma has room for the slowest edge") {
    ExposureBench ignorant;
    CHECK(ignorant.sigma(milliseconds(9)) == microseconds(100));
    CHECK(ignorant.sigma(milliseconds(9)) == microseconds(100));
    CHECK(ignorant.sigma(milliseconds(19)) > milliseconds(5));
    ExposureBench unwanted(false);
    unwanted.check.set_camera_exposure(milliseconds(2), {});
    CHECK_FALSE(unwanted.contradicts(milliseconds(9)));
    CHECK(unwanted.sigma(milliseconds(9)) == microseconds(100));
    ExposureBench bench;
    bench.check.set_camera_exposure(milliseconds(2), {});
    pairing::Exposure predicted;
    predicted.end = predicted.start + milliseconds(9);
    predicted.kind = StampKind::predicted_middle;
    CHECK_FALSE(bench.check.judge({}, {}, predicted, {}).contradicted);
}
