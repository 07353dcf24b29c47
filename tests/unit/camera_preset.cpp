// SPDX-License-Identifier: BSD-3-Clause
#include "settings/camera_preset.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>

#include "../support/message_table.hpp"
#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

std::vector<CameraPreset> all_presets() {
    auto presets = load_presets(VERSAVIS_SOURCE_DIR "/daemon/settings/presets");
    REQUIRE(presets);
    return *presets;
}

std::string chosen_preset(const std::string& vendor, const std::string& model) {
    const auto preset = choose_preset(all_presets(), "auto", vendor, model);
    REQUIRE(preset);
    return preset->name;
}

}  // namespace

TEST_CASE("camera_preset: each family is known by what its cameras call themselves") {
    CHECK(chosen_preset("FLIR", "Blackfly S BFS-PGE-23S3M") == "flir");
    CHECK(chosen_preset("Point Grey Research", "Grasshopper3 GS3-U3-23S6M") == "point-grey");
    CHECK(chosen_preset("Basler", "acA1920-50gm") == "basler");
    CHECK(chosen_preset("Basler", "a2A1920-51gmPRO") == "basler-ace2");
    CHECK(chosen_preset("Basler", "daA1280-54um") == "basler-dart");
    CHECK(chosen_preset("Lucid Vision Labs", "TRI023S-M") == "lucid");
    CHECK(chosen_preset("Allied Vision Technologies", "Mako G-131B") == "allied-vision-gige");
    CHECK(chosen_preset("Allied Vision", "1800 U-158m") == "alvium");
    CHECK(chosen_preset("The Imaging Source Europe GmbH", "DMK 33GX264") == "imaging-source");
    CHECK(chosen_preset("Teledyne DALSA", "Nano-C2420") == "dalsa");
    CHECK(chosen_preset("Point Grey Research", "Blackfly S BFS-PGE-13Y3M") == "flir");
    CHECK(chosen_preset("FLIR", "Oryx ORX-10G-51S5M") == "flir-oryx");
    CHECK(chosen_preset("FLIR Systems AB", "FLIR AX5") == "generic");
    CHECK(chosen_preset("Hikrobot", "MV-CA013-A0GM") == "hikrobot");
    CHECK(chosen_preset("Daheng Imaging", "MER-131-75GM") == "daheng");
    CHECK(chosen_preset("SVS-VISTEK GmbH", "evo4050") == "svs-vistek");
    CHECK(chosen_preset("Baumer Optronic", "HXG20") == "baumer");
    CHECK(chosen_preset("IDS Imaging Development Systems GmbH", "GV-5860") == "ids");
    CHECK(chosen_preset("JAI Corporation", "GO-5000M-PGE") == "jai");
    CHECK(chosen_preset("Imperx", "GEV-B1020C") == "imperx");
    CHECK(chosen_preset("Somebody", "Else") == "generic");
    CHECK(choose_preset(all_presets(), "lucid", "Basler", "a")->name == "lucid");
    CHECK(choose_preset(all_presets(), "lucied", "a", "b").error().message() ==
          "preset: there is no preset 'lucied' for this camera (a b); use one of: auto, alvium, "
          "basler-ace2, basler-dart, basler-usb, flir, flir-oryx, allied-vision-gige, basler, "
          "baumer, daheng, dalsa, hikrobot, ids, imaging-source, imperx, jai, lucid, point-grey, "
          "svs-vistek, generic");
}

TEST_CASE("camera_preset: makers state what differs, and take the rest from the base") {
    const auto base = choose_preset(all_presets(), base_preset, "", "");
    const auto hikrobot = choose_preset(all_presets(), "hikrobot", "", "");
    REQUIRE((base && hikrobot));
    CHECK(hikrobot->strobe_lines.front() == "Line1");
    CHECK(hikrobot->groups.at("trigger").size() == base->groups.at("trigger").size());
    CHECK(hikrobot->chunk_exposure == base->chunk_exposure);
    CHECK(choose_preset(all_presets(), "allied-vision-gige", "", "")->groups.at("chunks").empty());
    CHECK(choose_preset(all_presets(), "daheng", "", "")->line_inverter);
    CHECK_FALSE(base->line_inverter);
}

TEST_CASE("camera_preset: errors of preset files name line and key") {
    const test::TemporaryDirectory directory;
    const auto error = [&](const std::string& text) {
        const std::string path = directory.write("bad.toml", text);
        const auto loaded = load_presets(directory.path());
        return loaded ? std::string() : loaded.error().message().substr(path.size() + 1);
    };
    CHECK(load_presets(directory.path()).error().message() ==
          directory.path().string() +
              ": there are no camera presets in this directory; install them, or set "
              "'preset_directory' in the configuration");
    test::check_messages(
        error,
        {{"[[trigger]]\nsteps = [{ set = ['A'], to = ['B'], neded = true }]\n",
          "2:37: unknown key 'neded'; did you mean 'needed'?"},
         {"[[trigger]]\nsteps = [{ set = ['A'] }]\n",
          "2:18: a step needs 'set' and 'to'; give a list of names for each"},
         {"[[trigger]]\nset = ['A']\n", "1:1: 'steps' is missing or empty; give a list of them"},
         {"[[trigger]]\nselect = ['A']\n",
          "2:10: 'select' needs a selector and its value; see man versavis.toml"},
         {"stamp_instant = 'dawn'\n",
          "1:17: 'stamp_instant' must be one of start, middle, end, but is 'dawn'; see "
          "man versavis.toml"},
         {"[[line]]\nkind = 'direct'\n", "1:1: a [[line]] needs a 'name'; see man versavis.toml"},
         {"[[line]]\nname = 'Line1'\nkind = 'opt'\n",
          "3:8: 'kind' must be one of opto, direct, but is 'opt'; did you mean \"opto\"?"}});
    const std::string two_numbers =
        "4:20: 'output_rising_us' must be a list of 2 numbers from 0 to 1000; see "
        "man versavis.toml";
    test::check_messages(
        [&](const std::string& keys) {
            return error("[[line]]\nname = 'Line1'\nkind = 'opto'\n" + keys);
        },
        {{"output_rising_us = [36.0, 9]\n", test::accepted},
         {"output_rising_us = [36]\n", two_numbers},
         {"output_rising_us = 36\n", two_numbers},
         {"output_rising_us = [36, -1]\n", two_numbers},
         {"output_rising_us = ['a', 1]\n", two_numbers},
         {"output_rising_us = [36000, 1]\n", two_numbers},
         {"output_raising_us = [1, 1]\n",
          "4:1: unknown key 'output_raising_us'; did you mean 'output_rising_us'?"}});
}

TEST_CASE("camera_preset: lines are direct where the camera has such, and have their delays") {
    for (const char* name : {"flir", "basler-usb", "basler"}) {
        INFO(name);
        const auto preset = choose_preset(all_presets(), name, "", "");
        REQUIRE(preset);
        const auto strobe = std::find_if(
            preset->lines.begin(), preset->lines.end(),
            [&](const PresetLine& line) { return line.name == preset->strobe_lines.front(); });
        REQUIRE(strobe != preset->lines.end());
        CHECK((strobe->kind == LineKind::direct) == (std::string(name) != "basler"));
        REQUIRE((strobe->output_rising && strobe->output_falling));
        CHECK(strobe->output_rising->sigma.ns > 0);
    }
    CHECK(chosen_preset("Basler", "acA1920-155um") == "basler-usb");
    CHECK(chosen_preset("Basler", "a2A1920-160umPRO") == "basler-ace2");
}

TEST_CASE("camera_preset: a family may be known by what its cameras stamp") {
    test::TemporaryDirectory directory;
    directory.write("known.toml", "stamp_instant = \"end\"\n");
    directory.write("other.toml", "vendors = [\"else\"]\n");
    const auto presets = load_presets(directory.path());
    REQUIRE(presets);
    CHECK(choose_preset(*presets, "known", "", "")->stamp_instant == pairing::Instant::end);
    CHECK(choose_preset(*presets, "other", "", "")->stamp_instant == pairing::Instant::unknown);
}
