// SPDX-License-Identifier: BSD-3-Clause
#include "settings/configuration_document.hpp"

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"
#include "engine/toml/table_reader.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

const std::string two_cameras = R"(
instance = "one"
[ports]
pulse_us = 50
[[camera]]
name = "left"
device = "10.0.0.2"
output = 0
rate_hz = 20
[camera.features]
ExposureTime = 3000
[[camera]]
name = "right"
device = "10.0.0.3"
output = 1
[[imu]]
rate_hz = 200
)";

ConfigurationDocument document_of(const std::string& text) {
    const test::TemporaryDirectory directory;
    auto document = ConfigurationDocument::load(directory.write("versavis.toml", text));
    REQUIRE(document.has_value());
    return std::move(*document);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
}

/// "key" of each change, with "!" where it needs a restart.
std::vector<std::string> changes_to(const std::string& after) {
    std::vector<std::string> texts;
    for (const KeyChange& change : changes(document_of(two_cameras).root, document_of(after).root))
        texts.push_back(change.text() + (change.live() ? "" : "!"));
    return texts;
}

std::string first_problem(const Expected<ConfigurationDocument, TomlProblems>& document) {
    REQUIRE_FALSE(document.has_value());
    return document.error().front().message();
}

}  // namespace

TEST_CASE("configuration_document: what differs is named, and whether it can change now") {
    using Texts = std::vector<std::string>;
    CHECK(changes_to(two_cameras).empty());
    CHECK(changes_to("# a comment\n" + two_cameras).empty());
    CHECK(changes_to(replaced(two_cameras, "= 20\n", "= 25\n")) == Texts{"camera.left.rate_hz"});
    CHECK(changes_to(replaced(two_cameras, "3000", "2000")) == Texts{"camera.left.features"});
    CHECK(changes_to(replaced(two_cameras, "10.0.0.3", "10.0.0.4")) ==
          Texts{"camera.right.device!"});
    CHECK(changes_to(replaced(two_cameras, "\"right\"", "\"back\"")) ==
          Texts{"camera.right!", "camera.back!"});
    CHECK(changes_to(replaced(two_cameras, "= 200", "= 100")) == Texts{"imu.imu0.rate_hz!"});
    CHECK(changes_to(replaced(two_cameras, "= 50", "= 60")) == Texts{"ports.pulse_us"});
    CHECK(changes_to(two_cameras + "[illumination]\ncameras = [\"left\"]\n") ==
          Texts{"illumination.cameras"});
    CHECK(changes_to(two_cameras + "[memory]\nlock = true\n") == Texts{"memory.lock!"});
    CHECK(changes_to("log_level = \"debug\"\n" + replaced(two_cameras, "one", "two")) ==
          Texts{"instance!", "log_level"});
}

TEST_CASE("configuration_document: live keys are taken over, all others stay") {
    const ConfigurationDocument before = document_of(two_cameras);
    const auto next =
        document_of(replaced(replaced(two_cameras, "= 20\n", "= 25\nmax_temperature_c = 60\n"),
                             "= 200", "= 100") +
                    "[illumination]\ncameras = [\"left\"]\n");
    const auto merged = before.with_live_keys_of(next.root);
    REQUIRE(merged.has_value());
    const Configuration& configuration = merged->configuration;
    CHECK(configuration.cameras[0].rate_hz == 25);
    CHECK(configuration.cameras[0].max_temperature_c == 60);
    CHECK(configuration.imus[0].rate_hz == 200);
    CHECK(configuration.illumination.cameras == std::vector<std::string>{"left"});
    // And back: what is no longer in the file has its default again.
    const auto again = merged->with_live_keys_of(before.root);
    REQUIRE(again.has_value());
    CHECK(changes(before.root, again->root).empty());
    CHECK(again->configuration.cameras == before.configuration.cameras);
}

TEST_CASE("configuration_document: values of one camera are keys, or features") {
    const ConfigurationDocument before = document_of(two_cameras);
    const auto after = before.with("left", {{"rate_hz", "30"},
                                            {"ExposureTime", "1500.5"},
                                            {"Gain", "6"},
                                            {"PixelFormat", "\"Mono8\""},
                                            {"auto_exposure.target", "0.3"}});
    REQUIRE(after.has_value());
    const CameraConfiguration& camera = after->configuration.cameras[0];
    CHECK(camera.rate_hz == 30);
    CHECK(camera.auto_exposure.enabled);
    CHECK(camera.auto_exposure.target == 0.3);
    CHECK(camera.features ==
          std::vector<std::pair<std::string, std::string>>{
              {"ExposureTime", "1500.5"}, {"Gain", "6"}, {"PixelFormat", "Mono8"}});
    CHECK(after->configuration.cameras[1] == before.configuration.cameras[1]);
    const auto removed = after->with("left", {{"Gain", ""}, {"rate_hz", ""}});
    REQUIRE(removed.has_value());
    CHECK(removed->configuration.cameras[0].features.size() == 2);
    CHECK(removed->configuration.cameras[0].rate_hz == CameraConfiguration().rate_hz);
}

TEST_CASE("configuration_document: what a file may not say, no request may") {
    const ConfigurationDocument document = document_of(two_cameras);
    using Catch::Contains;
    CHECK_THAT(first_problem(document.with("left", {{"rate_hz", "-1"}})),
               Contains("'rate_hz' must be a number from"));
    CHECK_THAT(first_problem(document.with("left", {{"TriggerMode", "\"Off\""}})),
               Contains("is set by the service"));
    CHECK_THAT(first_problem(document.with("left", {{"auto_exposure.taget", "1"}})),
               Contains("taget") && Contains("target"));
    CHECK_THAT(first_problem(document.with("left", {{"rate_hz", "= ["}})), Contains("rate_hz"));
    CHECK_THAT(first_problem(document.with("left", {{"exposure_us", "60000"}})),
               Contains("exposure_us"));
}
