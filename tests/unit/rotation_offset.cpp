// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/rotation_offset.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "evaluate/picture_offsets.hpp"
#include "moving_world.hpp"
#include "verify/picture_judge.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;
using Catch::Contains;

namespace {

struct Score {
    double rms_s = 0;
    double sigma_s = 0;  ///< rms of what was claimed
    double nees = 0;     ///< mean square of the error in sigmas
    double rotation_nees = 0;
    double bias_nees = 0;
    int refused = 0;
    int rotations_shown = 0;
    std::string why;
};

Score score(const MovingWorld& world, int run_count) {
    Score result;
    int solved = 0;
    for (int seed = 0; seed < run_count; ++seed) {
        const Seen seen = OffsetSimulation(world, 1000U + static_cast<unsigned>(seed)).run();
        const auto found = rotation_offset(seen.frames, seen.gyro);
        if (!found) {
            ++result.refused;
            result.why = found.error().message();
            continue;
        }
        ++solved;
        result.rotations_shown += found->rotation_shown ? 1 : 0;
        const double error = found->offset_s - world.offset_s;
        result.rms_s += error * error;
        result.sigma_s += found->offset_sigma_s * found->offset_sigma_s;
        result.nees += std::pow(error / found->offset_sigma_s, 2);
        const Eigen::Vector3d off =
            rotation_of(found->camera_from_imu * rotation_by(true_rotation).conjugate());
        result.rotation_nees += off.cwiseQuotient(found->rotation_sigma).squaredNorm() / 3;
        result.bias_nees +=
            (found->gyro_bias - true_bias).cwiseQuotient(found->gyro_bias_sigma).squaredNorm() / 3;
    }
    result.rms_s = std::sqrt(result.rms_s / solved);
    result.sigma_s = std::sqrt(result.sigma_s / solved);
    result.nees /= solved;
    result.rotation_nees /= solved;
    result.bias_nees /= solved;
    return result;
}

void shake(std::vector<FrameRotation>& frames, double sigma) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0, sigma);
    for (FrameRotation& frame : frames)
        for (int i = 0; i < 3; ++i) frame.rotation[i] += normal(random);
}

constexpr int run_count = 30;

/// Errors in sigmas of 30 runs: their mean square scatters by 0.26 of itself.
void check_score(const Score& score) {
    CAPTURE(score.rms_s, score.sigma_s, score.nees, score.rotation_nees, score.bias_nees,
            score.why);
    CHECK(score.refused == 0);
    CHECK(score.rotations_shown == run_count);
    CHECK(score.nees > 0.35);
    CHECK(score.nees < 1.6);
    CHECK(score.rotation_nees > 0.35);
    CHECK(score.rotation_nees < 1.4);
    CHECK(score.bias_nees > 0.35);
    CHECK(score.bias_nees < 1.4);
}

}  // namespace

TEST_CASE("rotation_offset: 30 s of lively motion with good features", "[statistics]") {
    const Score found = score({}, run_count);
    check_score(found);
    CHECK(found.rms_s < 62e-6 * 1.25);
}

TEST_CASE("rotation_offset: poor features", "[statistics]") {
    MovingWorld world;
    world.camera_sigma = 2e-3;
    const Score found = score(world, run_count);
    check_score(found);
    CHECK(found.rms_s < 236e-6 * 1.25);
}

TEST_CASE("rotation_offset: one of ten rotations is an outlier", "[statistics]") {
    MovingWorld world;
    world.camera_sigma = 2e-3;
    world.outliers = 0.1;
    const Score found = score(world, run_count);
    check_score(found);
    CHECK(found.rms_s < 259e-6 * 1.25);
}

TEST_CASE("rotation_offset: slow motion shows less, and says so", "[statistics]") {
    MovingWorld world;
    world.camera_sigma = 2e-3;
    world.rate_rms = 0.2;
    world.bandwidth_hz = 1;
    const Score found = score(world, run_count);
    check_score(found);
    CHECK(found.rms_s < 1.3e-3 * 1.25);
}

TEST_CASE("rotation_offset: motion that is too slow is refused", "[statistics]") {
    MovingWorld world;
    world.camera_sigma = 2e-3;
    world.rate_rms = 0.05;
    world.bandwidth_hz = 0.5;
    const Score found = score(world, run_count);
    CHECK(found.refused == run_count);
    CHECK_THAT(found.why,
               Contains("the motion determines the offset only to within") && Contains("rad/s^2"));
}

TEST_CASE("rotation_offset: a rig at rest is refused", "[rotation_offset]") {
    MovingWorld world;
    world.rate_rms = 0;
    CHECK(score(world, 5).refused == 5);
}

TEST_CASE("rotation_offset: turns about one axis show the offset, but not the rotation",
          "[statistics]") {
    const double second_axis = GENERATE(0, 0.02, 0.1);
    CAPTURE(second_axis);
    double squares = 0;
    for (unsigned seed = 0; seed < run_count; ++seed) {
        MovingWorld world;
        world.axes = {0, second_axis, 1};
        const Seen seen = OffsetSimulation(world, 2000 + seed).run();
        const auto found = rotation_offset(seen.frames, seen.gyro);
        REQUIRE(found);
        CHECK_FALSE(found->rotation_shown);
        squares += std::pow((found->offset_s - world.offset_s) / found->offset_sigma_s, 2);
    }
    CHECK(squares / run_count > 0.35);
    CHECK(squares / run_count < 1.6);
}

TEST_CASE(
    "rotation_offset: a wrong focal length is found, and misleads neither offset nor rotation",
    "[statistics]") {
    const double scale = GENERATE(0.75, 0.98, 1.1);
    const double about_z = GENERATE(0.3, 2.0);
    CAPTURE(scale, about_z);
    double offset_nees = 0;
    double rotation_nees = 0;
    for (unsigned seed = 0; seed < run_count; ++seed) {
        MovingWorld world;
        world.axes = {1, 0.7, about_z};
        Seen seen = OffsetSimulation(world, 3000 + seed).run();
        for (FrameRotation& frame : seen.frames) frame.rotation.head<2>() *= scale;
        const auto found = rotation_offset(seen.frames, seen.gyro);
        REQUIRE(found);
        CHECK(found->camera_scale == Approx(scale).epsilon(0.005));
        offset_nees += std::pow((found->offset_s - world.offset_s) / found->offset_sigma_s, 2);
        const Eigen::Vector3d off =
            rotation_of(found->camera_from_imu * rotation_by(true_rotation).conjugate());
        rotation_nees += off.cwiseQuotient(found->rotation_sigma).squaredNorm() / 3;
    }
    CHECK(offset_nees / run_count < 1.6);
    CHECK(rotation_nees / run_count < 1.6);
}

TEST_CASE("rotation_offset: a focal length of another resolution is refused", "[rotation_offset]") {
    const double scale = GENERATE(0.5, 2.0);
    Seen seen = OffsetSimulation({}, 1).run();
    for (FrameRotation& frame : seen.frames) frame.rotation.head<2>() *= scale;
    const auto found = rotation_offset(seen.frames, seen.gyro);
    REQUIRE_FALSE(found);
    CHECK_THAT(found.error().message(), Contains("check the focal length"));
}

TEST_CASE("rotation_offset: periodic motion fits more than once", "[rotation_offset]") {
    Seen seen;
    const auto rate = [](double s) {
        const double phase = 2 * M_PI * 5 * s;
        return Eigen::Vector3d(0.5 * std::sin(phase), 0.5 * std::sin(phase + 1),
                               0.5 * std::cos(2 * phase));
    };
    for (int i = 0; i < 6400; ++i) seen.gyro.push_back({output_at(i * 0.005), rate(i * 0.005)});
    const GyroTrack track(seen.gyro, Eigen::Vector3d::Zero());
    for (int i = 0; i < 600; ++i) {
        const double from = 1 + i * 0.05;
        seen.frames.push_back(
            {output_at(from), output_at(from + 0.05),
             rotation_of(track.orientation(from).conjugate() * track.orientation(from + 0.05)),
             Eigen::Vector3d::Constant(1e-3)});
    }
    shake(seen.frames, 1e-3);
    const auto found = rotation_offset(seen.frames, seen.gyro);
    REQUIRE_FALSE(found);
    CHECK_THAT(found.error().message(), Contains("fit nearly as well"));
}

TEST_CASE("rotation_offset: a steady cone shows a delay as a turn about its axis",
          "[rotation_offset]") {
    Seen seen;
    for (int i = 0; i < 6400; ++i) {
        const double phase = 2 * M_PI * 0.7 * i * 0.005;
        seen.gyro.push_back(
            {output_at(i * 0.005), {0.5 * std::sin(phase), 0.5 * std::cos(phase), 0}});
    }
    const GyroTrack track(seen.gyro, Eigen::Vector3d::Zero());
    for (int i = 0; i < 600; ++i) {
        const double from = 1 + i * 0.05;
        seen.frames.push_back(
            {output_at(from), output_at(from + 0.05),
             rotation_of(track.orientation(from).conjugate() * track.orientation(from + 0.05)),
             Eigen::Vector3d::Constant(1e-3)});
    }
    shake(seen.frames, 1e-3);
    const auto found = rotation_offset(seen.frames, seen.gyro);
    REQUIRE_FALSE(found);
    CHECK_THAT(found.error().message(), Contains("offset") && Contains("rotate the rig"));
}

TEST_CASE("rotation_offset: offsets of either sign and far off, a slow gyro and gaps in it",
          "[rotation_offset]") {
    for (const double offset : {-0.31, 0.0, 0.4}) {
        MovingWorld world;
        world.offset_s = offset;
        world.gyro_hz = 100;
        Seen seen = OffsetSimulation(world, 5).run();
        seen.gyro.erase(seen.gyro.begin() + 1500, seen.gyro.begin() + 1560);
        const auto found = rotation_offset(seen.frames, seen.gyro);
        REQUIRE(found);
        CHECK(found->offset_s == Approx(offset).margin(3e-4));
        CHECK(found->rotations < 580);
        CHECK(found->residual == Approx(0.5e-3).epsilon(0.2));
    }
}

TEST_CASE("rotation_offset: an offset out of range or too little data is reported",
          "[rotation_offset]") {
    const Seen seen = OffsetSimulation({}, 5).run();
    CHECK_FALSE(rotation_offset({}, seen.gyro));
    CHECK_FALSE(rotation_offset(seen.frames, {}));
    const std::vector<FrameRotation> few(seen.frames.begin(), seen.frames.begin() + 30);
    const auto too_few = rotation_offset(few, seen.gyro);
    REQUIRE_FALSE(too_few);
    CHECK_THAT(too_few.error().message(), Contains("only 30 rotations"));
    MovingWorld far;
    far.offset_s = 0.3;
    const Seen other = OffsetSimulation(far, 5).run();
    CHECK_FALSE(rotation_offset(other.frames, other.gyro, {milliseconds(100)}));
}

namespace {

/// Three minutes of frames whose stamps are later by this from the second one on.
PictureEvidence drive_with_step(Duration step, unsigned seed) {
    MovingWorld world;
    world.seconds = 181;
    world.camera_sigma = 1e-3;
    Seen seen = OffsetSimulation(world, seed).run();
    for (FrameRotation& frame : seen.frames)
        if (frame.from >= output_at(121)) {
            frame.from = frame.from + step;
            frame.to = frame.to + step;
        }
    return {picture_offsets({seen.frames, seen.gyro}), {}};
}

}  // namespace

TEST_CASE("picture_offsets: a step of the stamps against the pictures is found where it is") {
    const Duration step = GENERATE(milliseconds(1), -milliseconds(1), milliseconds(10));
    const PictureEvidence evidence = drive_with_step(step, 7);
    REQUIRE(evidence.offsets.size() == 9);
    const PictureJudge judge(evidence);
    REQUIRE(judge.usual());
    CHECK(absolute(judge.usual()->offset - microseconds(12'300)) < microseconds(300));
    CHECK_FALSE(judge.off(output_at(50)));
    const auto off = judge.off(output_at(150));
    REQUIRE(off);
    CHECK(absolute(*off + step) < microseconds(300));
}

TEST_CASE("picture_offsets: honest stamps are not doubted, and a wrong calibration is named") {
    for (unsigned seed = 0; seed < 10; ++seed) {
        PictureEvidence evidence = drive_with_step({}, seed);
        for (int s = 1; s < 181; ++s) CHECK_FALSE(PictureJudge(evidence).off(output_at(s)));
        evidence.calibrated = microseconds(12'300);
        CHECK_FALSE(PictureJudge(evidence).off(output_at(50)));
        evidence.calibrated = milliseconds(8);
        CHECK(PictureJudge(evidence).off(output_at(50)));
    }
}

TEST_CASE("picture_offsets: at rest nothing is compared, and nothing is doubted") {
    MovingWorld world;
    world.seconds = 100;
    world.rate_rms = 1e-4;
    const Seen seen = OffsetSimulation(world, 1).run();
    const PictureEvidence evidence{picture_offsets({seen.frames, seen.gyro}), {}};
    CHECK(evidence.offsets.empty());
    CHECK_FALSE(PictureJudge(evidence).off(output_at(50)));
}
