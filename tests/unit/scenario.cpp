// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using rig::load_scenario;
using rig::Scenario;
using versavis::test::TemporaryDirectory;

namespace {

Expected<Scenario> load_rig(const std::string& text) {
    const TemporaryDirectory directory;
    return load_scenario(directory.write("scenario.toml", text));
}

std::string scenario_refusal(const std::string& text) {
    const auto scenario = load_rig(text);
    return scenario ? "" : scenario.error().message();
}

const std::string rig_section = "[[camera]]\nname = \"cam0\"\naddress = \"127.0.0.2\"\n";

}  // namespace

TEST_CASE("scenario: motion and LED board") {
    const auto scenario = load_rig(
        "[motion]\nrate_rad_s = [0.1, 0, 3]\nhighest_hz = 5\ntones = 4\n"
        "[leds]\noutput = \"trigger2\"\nbackward = true\n" +
        rig_section +
        "leds = [10, 20, 300, 20.5]\nimu_rotation_deg = [0, -90, 0]\nblur_steps = 5\n");
    REQUIRE(scenario);
    CHECK_FALSE(scenario->motion.nods);
    CHECK(scenario->motion.rate_rad_s == std::vector<double>{0.1, 0, 3});
    CHECK(scenario->motion.tones == 4);
    CHECK(scenario->leds.present);
    CHECK(scenario->leds.output == 2);
    CHECK(scenario->leds.backward);
    CHECK(scenario->cameras[0].leds == std::vector<double>{10, 20, 300, 20.5});
    CHECK(scenario->cameras[0].imu_rotation_deg == std::vector<double>{0, -90, 0});
    CHECK(load_rig(rig_section)->motion.nods);
}

TEST_CASE("scenario: what is wrong is reported with its place") {
    using Catch::Contains;
    CHECK_THAT(scenario_refusal("[motion]\nrate = [1, 1, 1]\n"),
               Contains(":2:1") && Contains("rate_rad_s"));
    CHECK_THAT(scenario_refusal("[motion]\nrate_rad_s = [1, 1]\n"),
               Contains(":2:") && Contains("3 numbers"));
    CHECK_THAT(scenario_refusal("[motion]\nlowest_hz = 3\nhighest_hz = 2\n"),
               Contains(":3:") && Contains("below 'lowest_hz'"));
    CHECK_THAT(scenario_refusal("[leds]\noutput = \"light\"\n"),
               Contains(":2:") && Contains("one of test"));
    CHECK_THAT(scenario_refusal(rig_section + "leds = [0, 0, 9, 9]\n"),
               Contains(":4:") && Contains("[leds]"));
    CHECK_THAT(scenario_refusal("[leds]\n" + rig_section + "blur_steps = 17\n"), Contains(":5:"));
}
