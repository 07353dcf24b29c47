// SPDX-License-Identifier: BSD-3-Clause
#include "settings/camera_preset.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

std::vector<CameraPreset> all() {
    auto presets = load_presets(VERSAVIS_SOURCE_DIR "/daemon/settings/presets");
    REQUIRE(presets);
    return *presets;
}

std::string chosen(const std::string& vendor, const std::string& model) {
    const auto preset = choose_preset(all(), "auto", vendor, model);
    REQUIRE(preset);
    return preset->name;
}

}  // namespace

TEST_CASE("camera_preset: each family is known by what its cameras call themselves") {
    CHECK(chosen("FLIR", "Blackfly S BFS-PGE-23S3M") == "flir");
    CHECK(chosen("Point Grey Research", "Grasshopper3 GS3-U3-23S6M") == "point-grey");
    CHECK(chosen("Basler", "acA1920-50gm") == "basler");
    CHECK(chosen("Basler", "a2A1920-51gmPRO") == "basler-ace2");
    CHECK(chosen("Basler", "daA1280-54um") == "basler-dart");
    CHECK(chosen("Lucid Vision Labs", "TRI023S-M") == "lucid");
    CHECK(chosen("Allied Vision Technologies", "Mako G-131B") == "allied-vision-gige");
    CHECK(chosen("Allied Vision", "1800 U-158m") == "alvium");
    CHECK(chosen("The Imaging Source Europe GmbH", "DMK 33GX264") == "imaging-source");
    CHECK(chosen("Teledyne DALSA", "Nano-C2420") == "dalsa");
    CHECK(chosen("Point Grey Research", "Blackfly S BFS-PGE-13Y3M") == "flir");
    CHECK(chosen("FLIR", "Oryx ORX-10G-51S5M") == "flir-oryx");
    CHECK(chosen("FLIR Systems AB", "FLIR AX5") == "generic");
    CHECK(chosen("Hikrobot", "MV-CA013-A0GM") == "hikrobot");
    CHECK(chosen("Daheng Imaging", "MER-131-75GM") == "daheng");
    CHECK(chosen("SVS-VISTEK GmbH", "evo4050") == "svs-vistek");
    CHECK(chosen("Baumer Optronic", "HXG20") == "baumer");
    CHECK(chosen("IDS Imaging Development Systems GmbH", "GV-5860") == "ids");
    CHECK(chosen("JAI Corporation", "GO-5000M-PGE") == "jai");
    CHECK(chosen("Imperx", "GEV-B1020C") == "imperx");
    CHECK(chosen("Somebody", "Else") == "generic");
    CHECK(choose_preset(all(), "lucid", "Basler", "a")->name == "lucid");
    CHECK_THAT(choose_preset(all(), "lucied", "a", "b").error().message(),
               Catch::Contains("one of: auto, "));
}

TEST_CASE("camera_preset: makers state what differs, and take the rest from the base") {
    const auto base = choose_preset(all(), base_preset, "", "");
    const auto hikrobot = choose_preset(all(), "hikrobot", "", "");
    REQUIRE((base && hikrobot));
    CHECK(hikrobot->strobe_lines.front() == "Line1");
    CHECK(hikrobot->groups.at("trigger").size() == base->groups.at("trigger").size());
    CHECK(hikrobot->chunk_exposure == base->chunk_exposure);
    CHECK(choose_preset(all(), "allied-vision-gige", "", "")->groups.at("chunks").empty());
    CHECK(choose_preset(all(), "daheng", "", "")->line_inverter);
    CHECK_FALSE(base->line_inverter);
}

TEST_CASE("camera_preset: errors of preset files name line and key") {
    test::TemporaryDirectory directory;
    CHECK_THAT(load_presets(directory.path()).error().message(),
               Catch::Contains("no camera presets"));
    directory.write("bad.toml",
                    "vendors = [\"a\"]\n[[trigger]]\nsteps = [{ set = [\"A\"], to = [\"B\"], neded "
                    "= true }]\n");
    const std::string message = load_presets(directory.path()).error().message();
    CHECK_THAT(message, Catch::Contains("bad.toml") && Catch::Contains("needed"));
    directory.write("bad.toml", "[[trigger]]\nsteps = [{ set = [\"A\"] }]\n");
    CHECK_THAT(load_presets(directory.path()).error().message(), Catch::Contains("'set' and 'to'"));
    directory.write("bad.toml", "[[trigger]]\nset = [\"A\"]\n");
    CHECK_THAT(load_presets(directory.path()).error().message(), Catch::Contains("'steps'"));
    directory.write("bad.toml", "[[trigger]]\nselect = [\"A\"]\n");
    CHECK_THAT(load_presets(directory.path()).error().message(), Catch::Contains("a selector and"));
}

TEST_CASE("camera_preset: lines are direct where the camera has such, and have their delays") {
    for (const char* name : {"flir", "basler-usb", "basler"}) {
        INFO(name);
        const auto preset = choose_preset(all(), name, "", "");
        REQUIRE(preset);
        const auto strobe = std::find_if(
            preset->lines.begin(), preset->lines.end(),
            [&](const PresetLine& line) { return line.name == preset->strobe_lines.front(); });
        REQUIRE(strobe != preset->lines.end());
        CHECK((strobe->kind == LineKind::direct) == (std::string(name) != "basler"));
        REQUIRE((strobe->output_rising && strobe->output_falling));
        CHECK(strobe->output_rising->sigma.ns > 0);
    }
    CHECK(chosen("Basler", "acA1920-155um") == "basler-usb");
    CHECK(chosen("Basler", "a2A1920-160umPRO") == "basler-ace2");
}

TEST_CASE("camera_preset: a line that does not add up is refused, with its place") {
    test::TemporaryDirectory directory;
    const auto error = [&](const std::string& keys) {
        directory.write("bad.toml", "[[line]]\nname = \"Line1\"\nkind = \"opto\"\n" + keys);
        const auto loaded = load_presets(directory.path());
        return loaded ? std::string("no error") : loaded.error().message();
    };
    CHECK(error("output_rising_us = [36.0, 9]\n") == "no error");
    for (const char* keys :
         {"output_rising_us = [36]\n", "output_rising_us = 36\n", "output_rising_us = [36, -1]\n",
          "output_rising_us = [\"a\", 1]\n", "output_rising_us = [36000, 1]\n"})
        CHECK_THAT(error(keys), Catch::Contains("bad.toml:4:") && Catch::Contains("2 numbers"));
    CHECK_THAT(error("output_raising_us = [1, 1]\n"), Catch::Contains("output_rising_us"));
    directory.write("bad.toml", "[[line]]\nkind = \"direct\"\n");
    CHECK_THAT(load_presets(directory.path()).error().message(), Catch::Contains("'name'"));
    directory.write("bad.toml", "[[line]]\nname = \"Line1\"\nkind = \"opt\"\n");
    CHECK_THAT(load_presets(directory.path()).error().message(), Catch::Contains("opto, direct"));
}

TEST_CASE("camera_preset: a family may be known by what its cameras stamp") {
    test::TemporaryDirectory directory;
    directory.write("known.toml", "stamp_instant = \"end\"\n");
    directory.write("other.toml", "vendors = [\"else\"]\n");
    const auto presets = load_presets(directory.path());
    REQUIRE(presets);
    CHECK(choose_preset(*presets, "known", "", "")->stamp_instant == pairing::Instant::end);
    CHECK(choose_preset(*presets, "other", "", "")->stamp_instant == pairing::Instant::unknown);
    directory.write("known.toml", "stamp_instant = \"dawn\"\n");
    CHECK_FALSE(load_presets(directory.path()));
}
