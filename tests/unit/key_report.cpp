// SPDX-License-Identifier: BSD-3-Clause
#include "settings/key_report.hpp"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

using namespace versavis;
using nlohmann::json;

namespace {

const std::vector<daemon::KeyDescription> described_keys{
    {"", "instance", "`\"default\"`", "a name", "distinguishes services"},
    {"[[camera]]", "device", "", "text, unique", "address of the camera"},
};

}  // namespace

TEST_CASE("key_report: keys stand below their table, without Markdown") {
    CHECK(daemon::to_text(described_keys) ==
          "instance            distinguishes services\n"
          "                    a name; default: \"default\"\n"
          "\n[[camera]]\n"
          "device              address of the camera\n"
          "                    text, unique\n");
}

TEST_CASE("key_report: in JSON each key has all members") {
    CHECK(json::parse(daemon::to_json(described_keys)) ==
          json{{{"table", ""},
                {"key", "instance"},
                {"default", "\"default\""},
                {"range", "a name"},
                {"meaning", "distinguishes services"}},
               {{"table", "[[camera]]"},
                {"key", "device"},
                {"default", ""},
                {"range", "text, unique"},
                {"meaning", "address of the camera"}}});
}
