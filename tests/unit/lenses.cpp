// SPDX-License-Identifier: BSD-3-Clause
#include "recording/lenses.hpp"

#include <fmt/format.h>

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::client;
using Catch::Matchers::Contains;

namespace {

std::string camera(const std::string& key, const std::string& topic,
                   const std::string& model = "pinhole", double fx = 300) {
    return fmt::format(
        "{}:\n  camera_model: {}\n  intrinsics: [{:.1f}, 301.0, 160.0, 120.0]\n"
        "  distortion_model: radtan\n  distortion_coeffs: [-0.25, 0.5, 0.0, 0.0]\n"
        "  resolution: [320, 240]\n  rostopic: {}\n",
        key, model, fx, topic);
}

}  // namespace

TEST_CASE("lenses: cameras are known by their topics") {
    const auto [topic, stream] =
        GENERATE(table<std::string, std::string>({{"/cam7/image_raw", "cam7"},
                                                  {"/car/cam7/image_raw", "cam7"},
                                                  {"/car/front/cam7/image_raw/compressed", "cam7"},
                                                  {"/front_left/image_raw", "front-left"},
                                                  {"/cam7/anything", "cam7"}}));
    const auto lenses = parse_lenses(camera("cam0", topic), "chain.yaml");
    REQUIRE(lenses);
    CHECK(lenses->left_out.empty());
    const RosLens* lens = lenses->find(stream);
    REQUIRE(lens != nullptr);
    CHECK(lens->fx == 300);
    CHECK(lens->distortion == "plumb_bob");
    CHECK(lens->coefficients == std::vector{-0.25, 0.5, 0.0, 0.0, 0.0});
    CHECK(lenses->find("cam0") == nullptr);
}

TEST_CASE("lenses: of two that may be meant, none is taken") {
    const auto lenses = parse_lenses(camera("cam0", "/front/cam0/image_raw") +
                                         camera("cam1", "/rear/cam0/image_raw", "pinhole", 400),
                                     "chain.yaml");
    REQUIRE(lenses);
    CHECK(lenses->find("cam0") == nullptr);
    CHECK(lenses->find("front")->fx == 300);
    CHECK(lenses->find("rear")->fx == 400);
    CHECK_THAT(lenses->misfit("cam0", 320, 240), Contains("more than one"));
}

TEST_CASE("lenses: what CameraInfo cannot say is left out, with the reason") {
    const auto [text, why] = GENERATE(table<std::string, std::string>(
        {{camera("cam0", "/cam0/image_raw", "omni"), "no name for omni with radtan"},
         {camera("cam0", "image"), "names no camera"},
         {camera("cam0", "/image_raw"), "names no camera"}}));
    const auto lenses = parse_lenses(text + camera("cam1", "/cam1/image_raw"), "chain.yaml");
    REQUIRE(lenses);
    REQUIRE(lenses->left_out.size() == 1);
    CHECK_THAT(lenses->left_out[0], Contains("chain.yaml: cam0: ") && Contains(why));
    CHECK(lenses->by_topic.size() == 1);
}

TEST_CASE("lenses: a lens of another size than the frames is named") {
    const auto lenses = parse_lenses(camera("cam0", "/cam0/image_raw"), "chain.yaml");
    CHECK(lenses->misfit("cam0", 320, 240).empty());
    CHECK(Lenses().misfit("cam1", 640, 480).empty());
    CHECK_THAT(lenses->misfit("cam1", 640, 480),
               Contains("cam1: no camera of the calibration has its topic"));
    CHECK(lenses->misfit("cam0", 640, 480) ==
          "cam0: it was calibrated at 320 x 240, and its frames have 640 x 480");
}

TEST_CASE("lenses: of several files, later ones count") {
    const test::TemporaryDirectory files;
    const auto first = files.write(
        "a.yaml", camera("cam0", "/cam0/image_raw") + camera("cam1", "/cam1/image_raw"));
    const auto second = files.write("b.yaml", camera("cam0", "/cam0/image_raw", "pinhole", 400));
    const auto lenses = read_lenses({first, second});
    REQUIRE(lenses);
    CHECK(lenses->find("cam0")->fx == 400);
    CHECK(lenses->find("cam1")->fx == 300);
    CHECK_THAT(read_lenses({first, "/nowhere.yaml"}).error().message(),
               Contains("/nowhere.yaml: cannot be read"));
    CHECK_THAT(read_lenses({files.write("c.yaml", "cam0: 3\n")}).error().message(),
               Contains("c.yaml"));
}
