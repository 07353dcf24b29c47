// SPDX-License-Identifier: BSD-3-Clause
#include "engine/toml/service_file.hpp"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>

#include "../support/temporary_directory.hpp"
#include "settings/configuration_document.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

const std::string left = "[[camera]]\nname = \"left\"\ndevice = \"10.0.0.2\"\nrate_hz = 20\n";
const std::string right = "[[camera]]\nname = \"right\"\ndevice = \"10.0.0.3\"\noutput = 1\n";

/// A configuration and its folder.
class Files {
 public:
    explicit Files(const std::string& text) : main(directory.write("v.toml", text)) {}

    std::string add(const std::string& name, const std::string& text) const {
        std::filesystem::create_directory(folder());
        return directory.write("v.toml.d/" + name, text);
    }
    std::string folder() const { return main + ".d"; }
    Configuration loaded() const {
        auto read = load_configuration(main);
        INFO((read ? "" : read.error().front().message()));
        REQUIRE(read.has_value());
        return std::move(*read);
    }
    /// From the folder's path on, one a line.
    std::string errors() const {
        const auto read = load_configuration(main);
        std::string all;
        for (const TomlProblem& problem : read ? TomlProblems{} : read.error()) {
            std::string message = problem.message();
            const std::string prefix = directory.path().string() + "/";
            for (auto at = message.find(prefix); at != std::string::npos; at = message.find(prefix))
                message.erase(at, prefix.size());
            all += (all.empty() ? "" : "\n") + message;
        }
        return all;
    }

    test::TemporaryDirectory directory;
    std::string main;
};

}  // namespace

TEST_CASE("service_file: without a folder, or with an empty one, the file is all there is") {
    const Files files(left);
    CHECK(*service_files(files.main) == std::vector<std::string>{files.main});
    CHECK(files.loaded().cameras.size() == 1);
    std::filesystem::create_directory(files.folder());
    CHECK(*service_files(files.main) == std::vector<std::string>{files.main});
    CHECK(files.loaded().cameras.size() == 1);
    CHECK(*service_text(files.main) == left);
}

TEST_CASE("service_file: files are read by name, and what is no TOML file is left alone") {
    const Files files(left);
    const std::string second = files.add("20-b.toml", "log_level = \"debug\"\n");
    const std::string first = files.add("10-a.toml", "log_level = \"error\"\ninstance = \"one\"\n");
    for (const char* other : {"30.toml~", "30.toml.bak", "README", ".30.toml.swp", ".#30.toml"})
        files.add(other, "nothing that is TOML");
    CHECK(*service_files(files.main) == std::vector<std::string>{files.main, first, second});
    CHECK(files.loaded().log_level == LogLevel::debug);
    CHECK(files.loaded().instance == "one");
}

TEST_CASE("service_file: tables are merged key by key, and a later value replaces an earlier one") {
    const Files files(left +
                      "[camera.features]\nGain = 1\nGamma = 2\n[ports]\npulse_us = 50\n"
                      "inputs = [\"pps\", \"aux0\"]\n");
    files.add("10.toml", "[ports]\ninputs = [\"sync\"]\n[clock]\nalign = true\n");
    files.add("20.toml",
              "[[camera]]\nname = \"left\"\nrate_hz = 30\n[camera.features]\nGain = 3\n");
    const Configuration all = files.loaded();
    CHECK(all.ports.pulse_us == 50);
    CHECK(all.ports.inputs == std::vector<std::string>{"sync"});
    CHECK(all.clock.align);
    REQUIRE(all.cameras.size() == 1);
    CHECK(all.cameras[0].device == "10.0.0.2");
    CHECK(all.cameras[0].rate_hz == 30);
    CHECK(all.cameras[0].features ==
          std::vector<std::pair<std::string, std::string>>{{"Gain", "3"}, {"Gamma", "2"}});
}

TEST_CASE("service_file: cameras and IMUs go by their names, and a new name is a new one") {
    const Files files(left + "[[imu]]\nrate_hz = 200\n");
    files.add("10.toml", right + "[[camera]]\nname = \"left\"\nrate_hz = 25\n");
    files.add("20.toml",
              "[[camera]]\nname = \"right\"\nrate_hz = 10\n[[imu]]\nname = \"imu0\"\n"
              "rate_hz = 100\n");
    const Configuration all = files.loaded();
    REQUIRE(all.cameras.size() == 2);
    CHECK(all.cameras[0].name == "left");
    CHECK(all.cameras[0].rate_hz == 25);
    CHECK(all.cameras[1].name == "right");
    CHECK(all.cameras[1].rate_hz == 10);
    REQUIRE(all.imus.size() == 1);
    CHECK(all.imus[0].rate_hz == 100);
}

TEST_CASE("service_file: an error names the file and the line that its value came from") {
    const Files files(left);
    files.add("10.toml", "\n[[camera]]\nname = \"left\"\nrate_hz = 3000\n");
    files.add("20.toml", "[clock]\nalinge = true\n" + right + "[camera.features]\nrate_hz = 2\n");
    files.add("30.toml", "[[camera]]\nname = \"back\"\ndevice = \"10.0.0.4\"\n");
    CHECK(files.errors() ==
          "v.toml.d/10.toml:4:11: 'rate_hz' must be a number from 0.1 to 1000 Hz, but is 3000; see "
          "man versavis.toml\n"
          "v.toml.d/20.toml:2:1: unknown key 'alinge'; did you mean 'align'?\n"
          "v.toml.d/20.toml:8:11: 'rate_hz' is a key of the camera, not a feature; move it above "
          "[camera.features]\n"
          "v.toml.d/30.toml:1:1: output 0 is already used by [[camera]] \"left\" on line 1 of "
          "v.toml; free outputs: 2, 3");
}

TEST_CASE("service_file: all files that are no TOML are named at once") {
    const Files files(left);
    files.add("10.toml", "a = \n");
    files.add("20.toml", "[clock]\nalign = true\n");
    files.add("30.toml", "b = “x”\n");
    CHECK_THAT(files.errors(), Catch::StartsWith("v.toml.d/10.toml:1:") &&
                                   Catch::Contains("\nv.toml.d/30.toml:1:5: there is a curly "
                                                   "quote here, which TOML does not know"));
}

TEST_CASE("service_file: a name stands once in a file") {
    const Files once(left);
    once.add("10.toml", right + "[[camera]]\nname = \"right\"\nrate_hz = 10\n[[imu]]\n[[imu]]\n");
    CHECK(once.errors() ==
          "v.toml.d/10.toml:5:1: this file has two [[camera]] 'right'; make one of the two tables, "
          "or choose another name\n"
          "v.toml.d/10.toml:9:1: this file has two [[imu]] 'imu0'; make one of the two tables, or "
          "choose another name");
    const Files in_main(left + left);
    in_main.add("10.toml", "[clock]\nalign = true\n");
    CHECK_THAT(in_main.errors(), Catch::Contains("v.toml:6:8: the name 'left' is already used"));
}

TEST_CASE("service_file: a value of another kind replaces what was there, and is refused") {
    const Files files(left + "[clock]\nalign = true\n");
    files.add("10.toml", "camera = 3\nclock = 4\n");
    CHECK(files.errors() ==
          "v.toml.d/10.toml:1:10: 'camera' must be an array of tables: [[camera]], but is 3; see "
          "man versavis.toml\n"
          "v.toml.d/10.toml:2:9: 'clock' must be a table: [clock], but is 4; see man "
          "versavis.toml");
}

TEST_CASE("service_file: a folder or a file that cannot be read is an error") {
    const Files files(left);
    std::filesystem::create_directories(files.folder() + "/10.toml");
    CHECK(files.errors() ==
          "v.toml.d/10.toml: is not a regular file; give the path of a readable file");
    std::filesystem::remove_all(files.folder());
    files.directory.write("v.toml.d", "");
    CHECK(files.errors() ==
          "v.toml.d: is not a folder; make it a folder that the service can read, or remove it");
    std::filesystem::remove(files.folder());
    std::filesystem::create_symlink("v.toml.d", files.folder());
    CHECK_THAT(files.errors(), Catch::StartsWith("v.toml.d: cannot be read: "));
    std::filesystem::remove(files.folder());
    const std::string locked = files.add("10.toml", "[clock]\nalign = true\n");
    std::filesystem::create_symlink("nowhere", files.folder() + "/20.toml");
    CHECK(files.errors() ==
          "v.toml.d/20.toml: there is no such file; give the path of a readable file");
    std::filesystem::remove(files.folder() + "/20.toml");
    std::filesystem::permissions(locked, std::filesystem::perms::none);
    if (::geteuid() != 0)
        CHECK(files.errors() ==
              "v.toml.d/10.toml: cannot be opened: Permission denied; give the path of a "
              "readable file");
    for (int i = 0; i < 100; ++i) files.add("f" + std::to_string(i) + ".toml", "");
    CHECK(files.errors() ==
          "v.toml.d: has more than 99 configuration files; make it a folder that the service can "
          "read, or remove it");
}

TEST_CASE("service_file: as one text it says what is in force, and from where") {
    const Files files(left);
    files.add("10.toml", "[[camera]]\nname = \"left\"\nrate_hz = 30\n");
    const std::string text = *service_text(files.main);
    CHECK_THAT(text, Catch::StartsWith("# " + files.main + "\n# " + files.folder() + "/10.toml\n"));
    const Files merged(text);
    CHECK(merged.loaded().cameras[0].rate_hz == 30);
    CHECK(merged.loaded().cameras[0].device == "10.0.0.2");
}

TEST_CASE("service_file: a document is read with its folder, and changes by request as before") {
    const Files files(left);
    auto before = ConfigurationDocument::load(files.main);
    REQUIRE(before.has_value());
    files.add("10.toml", "[[camera]]\nname = \"left\"\nrate_hz = 30\n");
    const auto after = ConfigurationDocument::load(files.main);
    REQUIRE(after.has_value());
    const auto differ = changes(before->root, after->root);
    REQUIRE(differ.size() == 1);
    CHECK(differ[0].text() == "camera.left.rate_hz");
    CHECK(after->configuration.entry.place.path == files.main);
    const auto set = after->with("left", {{"rate_hz", "40"}});
    REQUIRE(set.has_value());
    CHECK(set->configuration.cameras[0].rate_hz == 40);
    CHECK(set->configuration.entry.place.path == files.main);
}
