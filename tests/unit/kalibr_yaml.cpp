// SPDX-License-Identifier: BSD-3-Clause
#include "export/kalibr_yaml.hpp"

#include <catch2/catch.hpp>

#include "export/time_shift.hpp"

using namespace versavis;
using namespace versavis::client;

namespace {

constexpr auto chain = R"(cam0:
  T_cam_imu:
  - [0.0, -1.0, 0.0, 0.1]
  - [1.0, 0.0, 0.0, 0.2]
  - [0.0, 0.0, 1.0, 0.3]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.05, 0.0001, -1.0e-05]
  distortion_model: radtan
  intrinsics: [461, 460.5, 362.0, 246.25]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.001234
cam1:
  camera_model: pinhole
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [1.0, 1.0, 1.0, 1.0]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
  timeshift_cam_imu: -2.5e-05
)";

}  // namespace

TEST_CASE("kalibr_yaml: a camchain is read, written and read to the same") {
    const auto cameras = parse_camchain(chain, "a.yaml");
    REQUIRE(cameras);
    REQUIRE(cameras->size() == 2);
    CHECK(cameras->at(0).intrinsics[0] == 461);
    CHECK(cameras->at(0).from_imu->at(3) == 0.1);
    CHECK(*cameras->at(1).time_shift_s == -2.5e-05);
    const std::string text = camchain_text(*cameras);
    CHECK(text.find("[461.0, 460.5, 362.0, 246.25]") != std::string::npos);
    const auto again = parse_camchain(text, "b.yaml");
    REQUIRE(again);
    CHECK(camchain_text(*again) == text);
    const Transform back = inverse(inverse(*cameras->at(0).from_imu));
    for (std::size_t i = 0; i < 16; ++i)
        CHECK(back[i] == Approx(cameras->at(0).from_imu->at(i)).margin(1e-12));
}

TEST_CASE("kalibr_yaml: what is wrong is told by file and line") {
    for (const char* text : {"", "cam0: 3", "x: 1", "cam0:\n  camera_model: pinhole\n", ": [",
                             "cam0: {camera_model: p, intrinsics: [a], distortion_model: n}",
                             "cam0: {camera_model: p, intrinsics: [1,1,1,1], distortion_model: n, "
                             "resolution: [1,2], T_cam_imu: [[1,2],[3]]}"})
        CHECK_FALSE(parse_camchain(text, "a.yaml"));
    const auto bad = parse_camchain("cam0:\n  camera_model: pinhole\n", "a.yaml");
    CHECK(bad.error().where == "a.yaml:2");
    CHECK_FALSE(parse_imu_noise("accelerometer_noise_density: 0.1", "imu.yaml"));
    const ImuNoise noise{0.01, 0.001, 0.002, 3e-05};
    const auto again = parse_imu_noise(imu_text(noise, "/imu0", 200), "imu.yaml");
    REQUIRE(again);
    CHECK(again->gyroscope_walk == 3e-05);
    CHECK_FALSE(parse_imu_noise(imu_text({0, 1, 1, 1}, "/imu0", 200), "imu.yaml"));
}

TEST_CASE("time_shift: the configured delay is the filter's and what Kalibr found on top") {
    const auto cameras = parse_camchain(chain, "a.yaml");
    const auto shift = time_shift(*cameras, Duration{3'662'000}, "a.yaml");
    REQUIRE(shift);
    CHECK(shift->total_s == Approx(0.004896));
    CHECK(to_text(*shift, false).find("filter_delay_us = 4896.0") != std::string::npos);
    CHECK(to_text(*shift, false).find("74.8 %") != std::string::npos);
    const auto unknown = time_shift(*cameras, {}, "a.yaml");
    CHECK(to_text(*unknown, true).find("\"filter_delay_us\":null") != std::string::npos);
    CHECK_FALSE(time_shift({CalibratedCamera{}}, {}, "a.yaml"));
}
