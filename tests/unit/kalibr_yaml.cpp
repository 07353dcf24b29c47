// SPDX-License-Identifier: BSD-3-Clause
#include "recording/kalibr_yaml.hpp"

#include <catch2/catch.hpp>
#include <map>

#include "export/time_shift.hpp"
#include "recording_file.hpp"
#include "temporary_directory.hpp"

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

TEST_CASE("kalibr_yaml: what is wrong is reported by file and line") {
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

TEST_CASE("kalibr_yaml: cameras in another order have the links of that order") {
    // Turned by 90 degrees about z, and about x.
    const Transform one{0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1};
    const Transform two{1, 0, 0, -0.5, 0, 0, -1, 0, 0, 1, 0, 0.25, 0, 0, 0, 1};
    std::vector<CalibratedCamera> cameras(3);
    cameras[0].overlaps = {1};
    cameras[1].overlaps = {0, 2};
    cameras[2].overlaps = {1};
    cameras[1].to_previous = one;
    cameras[2].to_previous = two;
    const auto same = rearranged(cameras, {0, 1, 2});
    CHECK(same[1].to_previous == one);
    CHECK(same[2].to_previous == two);
    CHECK(same[1].overlaps == std::vector<std::uint32_t>{0, 2});

    const auto swapped = rearranged(cameras, {1, 0});
    CHECK_FALSE(swapped[0].to_previous);
    for (std::size_t i = 0; i < 16; ++i)
        CHECK(swapped[1].to_previous->at(i) == Approx(inverse(one)[i]).margin(1e-12));
    CHECK(swapped[0].overlaps == std::vector<std::uint32_t>{1});

    // Of two after one: rows of the one's rotation are turned, and its origin is moved.
    const auto without_middle = rearranged(cameras, {0, 2});
    const Transform both{0, -1, 0, -0.4, 0, 0, -1, -0.3, 1, 0, 0, 0.45, 0, 0, 0, 1};
    for (std::size_t i = 0; i < 16; ++i)
        CHECK(without_middle[1].to_previous->at(i) == Approx(both[i]).margin(1e-12));
    CHECK(without_middle[0].overlaps.empty());

    const auto turned = rearranged(cameras, {2, 0, 1});
    for (std::size_t i = 0; i < 16; ++i)
        CHECK(turned[1].to_previous->at(i) == Approx(inverse(both)[i]).margin(1e-12));
    CHECK(turned[2].to_previous == one);
    CHECK(turned[0].overlaps == std::vector<std::uint32_t>{2});

    cameras[1].to_previous.reset();
    CHECK_FALSE(rearranged(cameras, {1, 0})[1].to_previous);
    cameras[0].from_imu = two;
    cameras[1].from_imu = Transform{both};
    for (std::size_t i = 0; i < 16; ++i)  // T_cam0_imu less T_cam1_imu: two less both
        CHECK(rearranged(cameras, {0, 1})[1].to_previous->at(i) ==
              Approx(inverse(*rearranged(cameras, {1, 0})[1].to_previous)[i]).margin(1e-12));
}

TEST_CASE("time_shift: the IMU that was calibrated is the only one, or is named") {
    const test::TemporaryDirectory directory;
    test::RecordingFile file;
    ImuMetadata sample{};
    for (const auto& [name, delay] : std::map<std::string, Duration>{{"imu0", microseconds(3662)},
                                                                     {"imu1", microseconds(700)}}) {
        sample.filter_delay = delay;
        file.add({name, ring::StreamKind::imu, 0, 1, {100}, pack(sample), {}});
        const auto recording = Recording::open(directory.write("a.mcap", [&] {
            auto copy = file;
            return copy.finish();
        }()));
        REQUIRE(recording);
        CHECK(recorded_filter_delay(*recording, name, "a")->ns == delay.ns);
        CHECK_FALSE(recorded_filter_delay(*recording, "imu7", "a"));
        const auto any = recorded_filter_delay(*recording, "", "a");
        CHECK(any.has_value() == (name == "imu0"));
        if (!any) CHECK_THAT(any.error().message(), Catch::Contains("imu0, imu1"));
    }
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
