// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/gyro_track.hpp"

#include <catch2/catch.hpp>
#include <cmath>

using namespace versavis;
using namespace versavis::client;

namespace {

Eigen::Vector3d wave(double s) {
    return {0.9 * std::sin(7 * s), 0.7 * std::cos(5 * s), 0.8 * std::sin(3 * s + 1)};
}

std::vector<GyroSample> samples(std::int64_t interval_ns, double until_s) {
    std::vector<GyroSample> all;
    for (std::int64_t ns = 0; static_cast<double>(ns) * 1e-9 <= until_s; ns += interval_ns)
        all.push_back({{ns + 1'000'000'000}, wave(static_cast<double>(ns) * 1e-9)});
    return all;
}

}  // namespace

TEST_CASE("gyro_track: a rotation's axis and angle, there and back", "[gyro_track]") {
    for (const Eigen::Vector3d& rotation :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1e-12, 0, -1e-12), Eigen::Vector3d(1e-5, 0, 0),
          Eigen::Vector3d(0.3, -0.2, 0.1), Eigen::Vector3d(0, 3.1, 0)})
        CHECK((rotation_of(rotation_by(rotation)) - rotation).norm() < 1e-12);
    const Eigen::Quaterniond other_sign(-rotation_by({0.1, 0, 0}).coeffs());
    CHECK(rotation_of(other_sign).x() == Approx(0.1));
}

TEST_CASE("gyro_track: a constant rate turns in proportion, less the bias", "[gyro_track]") {
    std::vector<GyroSample> all;
    for (std::int64_t i = 0; i < 100; ++i) all.push_back({{i * 10'000'000}, {0.1, 0.2, 0.3}});
    const GyroTrack track(all, {0.1, 0, 0});
    CHECK(track.end_s() == Approx(0.99));
    CHECK((rotation_of(track.orientation(0.5037)) - Eigen::Vector3d(0, 0.2, 0.3) * 0.5037).norm() <
          1e-12);
    CHECK((track.rate(0.5037) - Eigen::Vector3d(0, 0.2, 0.3)).norm() < 1e-12);
}

TEST_CASE("gyro_track: coning motion at 200 Hz agrees with a hundred times finer steps",
          "[gyro_track]") {
    const GyroTrack coarse(samples(5'000'000, 2), Eigen::Vector3d::Zero());
    Eigen::Quaterniond fine = Eigen::Quaterniond::Identity();
    constexpr double step = 5e-5;
    for (int i = 0; i < 38'765; ++i) fine = fine * rotation_by(wave((i + 0.5) * step) * step);
    const Eigen::Quaterniond error = coarse.orientation(38'765 * step).conjugate() * fine;
    // A chord below each curve is all that is lost: 1/12 of 44 rad/s^3 times 5 ms squared.
    CHECK(rotation_of(error).norm() < 5e-5);
    CHECK((coarse.rate(1.2345) - wave(1.2345)).norm() < 2e-4);
}
