// SPDX-License-Identifier: BSD-3-Clause
#include "verify/offset_watch.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <random>

#include "evaluate/picture_offsets.hpp"
#include "moving_world.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;

namespace {

constexpr Duration watched_stretch = seconds(15);

/// Stretches with normal errors, one after the other.
struct Watched {
    OffsetWatch watch;
    std::mt19937_64 random{1};
    OutputTime time{1'700'000'000'000'000'000};

    explicit Watched(std::optional<Duration> calibrated = {}) : watch(calibrated) {}

    void add(Duration offset, Duration sigma = microseconds(150)) {
        std::normal_distribution<double> normal(0, static_cast<double>(sigma.ns));
        watch.add(
            {time, time + watched_stretch, offset + Duration{std::llround(normal(random))}, sigma});
        time = time + watched_stretch;
    }
    void add(int count, Duration offset, Duration sigma = microseconds(150)) {
        for (int i = 0; i < count; ++i) add(offset, sigma);
    }
};

}  // namespace

TEST_CASE("offset_watch: a step of 1 ms is found with the second or third stretch, and its end") {
    const Duration step = GENERATE(milliseconds(1), -milliseconds(1), milliseconds(30));
    Watched drive;
    drive.add(20, milliseconds(3));
    REQUIRE(drive.watch.usual());
    CHECK(absolute(drive.watch.usual()->offset - milliseconds(3)) < microseconds(150));
    CHECK_FALSE(drive.watch.departure());
    const OutputTime begin = drive.time;
    drive.add(1, milliseconds(3) + step);
    CHECK_FALSE(drive.watch.departure());
    drive.add(2, milliseconds(3) + step);
    const auto found = drive.watch.departure();
    REQUIRE(found);
    CHECK(absolute(found->by - step) < microseconds(300));
    CHECK(found->sigma < microseconds(200));
    CHECK(absolute(found->since - begin) <= watched_stretch);
    drive.add(20, milliseconds(3) + step);
    REQUIRE(drive.watch.departure());
    CHECK(drive.watch.departure()->since == found->since);
    drive.add(2, milliseconds(3));
    CHECK_FALSE(drive.watch.departure());
}

TEST_CASE("offset_watch: one stretch that misleads is no alarm, nor are less than half a ms") {
    Watched drive;
    drive.add(10, {});
    for (int i = 0; i < 20; ++i) {
        drive.add(1, milliseconds(i % 2 == 0 ? 20 : -20));
        CHECK_FALSE(drive.watch.departure());
        drive.add(3, {});
    }
    drive.add(20, microseconds(400), microseconds(10));
    CHECK_FALSE(drive.watch.departure());
}

TEST_CASE("offset_watch: a slow drift is not learned") {
    Watched drive;
    drive.add(40, {});
    for (int i = 0; i < 200 && !drive.watch.departure(); ++i) drive.add(1, microseconds(10 * i));
    REQUIRE(drive.watch.departure());
    CHECK(drive.watch.departure()->by < milliseconds(1));
}

TEST_CASE("offset_watch: sigmas that are too small raise no alarm") {
    Watched drive;
    std::normal_distribution<double> normal(0, 1e6);
    for (int i = 0; i < 2000; ++i) {
        drive.add(1, {std::llround(normal(drive.random))}, microseconds(200));
        if (i > 50) CHECK_FALSE(drive.watch.departure());
    }
}

TEST_CASE("offset_watch: an offset that is not Kalibr's is named, until it is") {
    Watched drive(milliseconds(5));
    drive.add(10, milliseconds(7));
    REQUIRE(drive.watch.departure());
    CHECK(absolute(drive.watch.departure()->by - milliseconds(2)) < microseconds(200));
    drive.add(30, milliseconds(5));
    CHECK_FALSE(drive.watch.departure());
    CHECK(absolute(drive.watch.usual()->offset - milliseconds(5)) < microseconds(200));
    Watched right(milliseconds(5));
    right.add(10, milliseconds(5));
    CHECK_FALSE(right.watch.departure());
}

namespace {

/// 15 s of a robot that turns, seen by a camera that looks far.
MovingWorld ordinary() {
    MovingWorld world;
    world.seconds = 15;
    world.period_s = 0.1;
    world.camera_sigma = 0.1e-3;  // as of the rig at 240 x 180 pixels
    world.rate_rms = 0.3;
    world.bandwidth_hz = 1.5;
    world.axes = {0.15, 0.15, 1};
    world.parallax = 0.01;
    world.sway_rms = 0.0003;
    return world;
}

/// What the next 15 s are like; darkness and rest show nothing.
MovingWorld weather(std::mt19937_64& random) {
    const auto chance = [&](double share) {
        return std::uniform_real_distribution<double>()(random) < share;
    };
    MovingWorld world = ordinary();
    if (chance(0.5)) world.rate_rms = 0.1;
    if (chance(0.2)) world.rate_rms = 0.001;  // at rest
    if (chance(0.2)) {                        // rain
        world.camera_sigma = 1e-3;
        world.outliers = 0.2;
        world.lost = 0.2;
    }
    if (chance(0.1)) {  // a tunnel: few features, all at the sides
        world.camera_sigma = 1e-3;
        world.parallax = 0.04;
        world.sway_rms = 0.02;
    }
    if (chance(0.05)) world.lost = 0.9;  // darkness
    if (chance(0.05)) world.lorry_s = 6;
    return world;
}

double drive_hours() {
    const char* hours = std::getenv("VERSAVIS_DRIVE_HOURS");
    return hours == nullptr ? 2 : std::atof(hours);
}

std::optional<PictureOffset> compare(const MovingWorld& world, unsigned seed, OutputTime from) {
    const Seen seen = OffsetSimulation(world, seed).run();
    const auto found = rotation_offset(seen.frames, seen.gyro, {milliseconds(100)});
    if (!found) return std::nullopt;
    return PictureOffset{from,
                         from + watched_stretch,
                         {std::llround(found->offset_s * 1e9)},
                         {std::llround(found->offset_sigma_s * 1e9)}};
}

}  // namespace

TEST_CASE("offset_watch: drives in all weathers raise no alarm, and a step of 1 ms one in time",
          "[statistics]") {
    std::mt19937_64 random(7);
    const auto count = static_cast<unsigned>(drive_hours() * 240);
    OffsetWatch watch;
    std::size_t compared = 0;
    OutputTime time = output_at(0);
    for (unsigned i = 0; i < count; ++i, time = time + watched_stretch) {
        const auto offset = compare(weather(random), i, time);
        if (!offset) continue;
        ++compared;
        watch.add(*offset);
        CAPTURE(i, compared, offset->offset.ns, offset->sigma.ns);
        CHECK_FALSE(watch.departure());
    }
    CHECK(compared > count / 4);
    REQUIRE(watch.usual());
    CHECK(absolute(watch.usual()->offset - microseconds(12'300)) < microseconds(300));

    // In ordinary motion, within a minute: three stretches, and one that has begun before.
    MovingWorld plain = ordinary();
    plain.offset_s = 0.0113;
    for (unsigned i = 0; i < 3; ++i, time = time + watched_stretch) {
        const auto offset = compare(plain, count + i, time);
        REQUIRE(offset);
        watch.add(*offset);
    }
    REQUIRE(watch.departure());
    CHECK(absolute(watch.departure()->by + milliseconds(1)) < microseconds(400));
}
