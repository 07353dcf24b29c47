// SPDX-License-Identifier: BSD-3-Clause
#include "health/health_watch.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// A service with one camera at 20 Hz, in simulated time, looked at twice a second.
struct HealthBench {
    HealthBench() {
        status.started = now;
        status.board.state = BoardState::running;
        status.board.connections = 1;
        status.clock.state = clock::ClockState::locked;
        CameraStatus camera;
        camera.name = "cam0";
        camera.camera.state = CameraState::streaming;
        camera.camera.connections = 1;
        camera.pipeline.pairing = pairing::State::locked;
        status.cameras.push_back(camera);
        ImuStatus imu;
        imu.report.name = "imu0";
        imu.report.rate_hz = 200;
        status.imus.push_back(imu);
    }

    /// Half a second in which the camera delivers so much of its rate, and loses the rest.
    Diagnosis step(double share = 1) {
        now = now + milliseconds(500);
        PipelineReport& pipeline = status.cameras[0].pipeline;
        const auto whole = static_cast<std::uint64_t>(10 * share);
        pipeline.triggers += 10;
        pipeline.received += whole;
        pipeline.published += whole;
        pipeline.incomplete += 10 - whole;
        pipeline.refused[1] += 10 - whole;
        pipeline.last_record = now;
        if (!mute) pipeline.last_sign = now;
        status.imus[0].report.published += 100;
        status.now = now;
        watch.examine(status);
        return status.cameras[0].diagnosis;
    }

    bool mute = false;
    HostTime now{100'000'000'000};
    Status status;
    HealthWatch watch;
};

}  // namespace

TEST_CASE("health_watch: from the start to full, to a loss within two seconds, and back") {
    HealthBench bench;
    CHECK(bench.step().health == Health::starting);
    for (int i = 0; i < 3; ++i) bench.step();
    CHECK(bench.status.cameras[0].diagnosis.health == Health::ok);
    CHECK(bench.status.imus[0].diagnosis.health == Health::ok);
    CHECK(health(bench.status) == Health::ok);
    const HostTime began = bench.now;
    while (bench.step(0.5).health == Health::ok) REQUIRE(bench.now - began <= seconds(2));
    CHECK(bench.status.cameras[0].diagnosis.fault == Fault::packet_loss);
    const HostTime since = bench.status.cameras[0].diagnosis.since;
    CHECK(since == bench.now);
    bench.step(0.5);
    CHECK(bench.status.cameras[0].diagnosis.since == since);
    for (int i = 0; i < 8; ++i) bench.step();
    CHECK(health(bench.status) == Health::ok);
}

TEST_CASE("health_watch: a slow start's few triggers are looked at together") {
    HealthBench bench;
    CameraStatus& camera = bench.status.cameras[0];
    camera.pipeline.pairing = pairing::State::searching;
    const auto look = [&](std::uint64_t triggers) {
        bench.now = bench.now + milliseconds(500);
        camera.pipeline.triggers += triggers;
        camera.pipeline.received += 2 * triggers;
        camera.pipeline.last_sign = camera.pipeline.last_record = bench.now;
        bench.status.now = bench.now;
        bench.watch.examine(bench.status);
    };
    for (int i = 0; i < 20; ++i) look(10);
    CHECK(camera.recent.triggers == 20);
    CHECK(camera.diagnosis.fault == Fault::double_frames);
    for (int i = 0; i < 20; ++i) {
        look(i % 3 == 0 ? 1 : 0);
        CHECK(camera.diagnosis.fault == Fault::double_frames);
        CHECK(camera.recent.triggers >= 4);
    }
    for (int i = 0; i < 13; ++i) look(0);
    CHECK(camera.recent.triggers == 1);
    for (int i = 0; i < 3; ++i) look(0);
    CHECK(camera.recent.triggers == 0);
}

TEST_CASE("health_watch: frames that are published as suspect are not delivered") {
    HealthBench bench;
    for (int i = 0; i < 6; ++i) bench.step();
    for (int i = 0; i < 4; ++i) {
        bench.status.cameras[0].pipeline.suspect += 10;
        bench.step();
    }
    CHECK(bench.status.cameras[0].diagnosis.health == Health::degraded);
}

TEST_CASE("health_watch: why a camera has no frames outlasts its being opened anew") {
    HealthBench bench;
    for (int i = 0; i < 6; ++i) bench.step();
    PipelineReport& pipeline = bench.status.cameras[0].pipeline;
    bench.mute = true;
    pipeline.measured = false;
    for (int i = 0; i < 6; ++i) {
        pipeline.unmeasured += 10;
        pipeline.incomplete -= 10;  // nothing comes at all
        bench.step(0);
    }
    CHECK(bench.status.cameras[0].diagnosis.fault == Fault::no_exposure);
    bench.status.cameras[0].camera.state = CameraState::silent;
    bench.status.cameras[0].camera.since = bench.now;
    CHECK(bench.step(0).fault == Fault::no_exposure);
    bench.step(0);
    CHECK(bench.step(0).fault == Fault::camera_silent);
    bench.status.cameras[0].camera.state = CameraState::absent;
    CHECK(bench.step(0).fault == Fault::camera_absent);
}

TEST_CASE("health_watch: a camera that is opened again and again is not starting for ever") {
    HealthBench bench;
    bench.status.cameras[0].pipeline.pairing = pairing::State::searching;
    for (int i = 0; i < 20; ++i) {
        ++bench.status.cameras[0].camera.connections;
        bench.step(0);
    }
    CHECK(bench.status.cameras[0].diagnosis.health == Health::degraded);
    CHECK(bench.status.cameras[0].diagnosis.fault == Fault::packet_loss);
}

TEST_CASE("health_watch: what recovers keeps its fault until it is trusted again") {
    HealthBench bench;
    for (int i = 0; i < 6; ++i) bench.step();
    for (int i = 0; i < 4; ++i) bench.step(0.5);
    CHECK(bench.status.cameras[0].diagnosis.fault == Fault::packet_loss);
    for (int i = 0; i < 5; ++i) CHECK(bench.step().fault == Fault::packet_loss);
    for (int i = 0; i < 3; ++i) bench.step();
    CHECK(bench.status.cameras[0].diagnosis.fault == Fault::none);
}
