// SPDX-License-Identifier: BSD-3-Clause
#include "camera_family.hpp"

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"
#include "camera/description_check.hpp"
#include "gige_registers.hpp"

using namespace versavis;
using rig::CameraFamily;
using rig::CameraRegisters;
using rig::CameraScenario;
using rig::gige_xml;
using rig::load_camera_family;

namespace {

const std::string models = VERSAVIS_SOURCE_DIR "/clients/rig/models";

CameraFamily load_family(const std::string& name) {
    auto family = load_camera_family(models, name);
    if (!family) throw std::runtime_error(family.error().message());
    return *family;
}

CameraScenario family_settings() {
    CameraScenario settings;
    settings.width = 640;
    settings.height = 480;
    settings.exposure_us = 4000;
    return settings;
}

std::string error_of(const std::string& toml) {
    const test::TemporaryDirectory directory;
    directory.write("a.toml", toml);
    directory.write("a.xml", "");
    const auto family = load_camera_family(directory.path(), "a");
    return family ? "none" : family.error().message();
}

}  // namespace

TEST_CASE("camera_family: descriptions of all models are good") {
    for (const std::string name : {"ace", "blackfly-s", "hikrobot", "alvium"}) {
        const std::string text = gige_xml(640, 480, load_family(name));
        const auto good = daemon::check_description({{text.begin(), text.end()}, false});
        INFO(name << ": " << (good ? "good" : good.error().what));
        CHECK(good);
    }
}

TEST_CASE("camera_family: another program's settings go with the factory settings, each number") {
    for (const std::string name : {"ace", "blackfly-s", "hikrobot", "alvium"}) {
        INFO(name);
        const CameraFamily family = load_family(name);
        CameraRegisters registers(family_settings(), family, {});
        CHECK(registers.any(family.stalled));
        CHECK(registers.all(family.triggered));
        CHECK(registers.number(family.trigger_delay) >= 600);
        CHECK(registers.value(rig::reg_width) == 320);
        REQUIRE(registers.write(family.user_set_load->at, 1));
        CHECK_FALSE(registers.any(family.stalled));
        CHECK_FALSE(registers.all(family.triggered));
        CHECK(registers.number(family.trigger_delay) == 0);
        CHECK(registers.number(family.exposure) == 4000);
        CHECK(registers.value(rig::reg_width) == 640);
        CHECK(registers.value(rig::reg_payload_size) == 640 * 480);
    }
}

TEST_CASE("camera_family: what is locked while it acquires, and by another setting") {
    const CameraFamily family = load_family("blackfly-s");
    CameraRegisters registers(family_settings(), family, {});
    const std::uint32_t binning = family.binning->at;
    CHECK(registers.locked(binning, true));
    CHECK_FALSE(registers.locked(binning, false));
    const rig::Field trigger_mode = family.triggered.front().first;
    CHECK(registers.locked(trigger_mode.at, false));  // the sequencer was left on
    registers.write(family.user_set_load->at, 1);
    CHECK_FALSE(registers.locked(trigger_mode.at, false));
    CHECK(registers.locked(family.exposure.at, false));  // by auto exposure
}

TEST_CASE("camera_family: what refers to no register is an error with its place") {
    CHECK(error_of("[registers]\nA = \"0x11000\"\n[defaults]\nA = 1\n") == "none");
    CHECK_THAT(error_of("[registers]\nA = \"0x11000\"\n[defaults]\nB = 1\n"),
               Catch::Contains("a.toml:4:") && Catch::Contains("'B' is no register"));
    CHECK_THAT(error_of("[registers]\nA = \"0x11000 byte\"\n"),
               Catch::Contains("'0x11000 byte' is no register"));
    CHECK_THAT(error_of("[registers]\nA = \"0x20000\"\n"),
               Catch::Contains("'0x20000' is no register"));
    CHECK_THAT(load_camera_family(models, "none").error().message(), Catch::Contains("none.toml"));
}
