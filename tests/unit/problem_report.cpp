// SPDX-License-Identifier: BSD-3-Clause
#include "settings/problem_report.hpp"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

using namespace versavis;
using nlohmann::json;

TEST_CASE("problem_report: a problem has the members that mean something") {
    TomlProblem ranged{
        {"a.toml.d/b.toml", 4, 11}, "[[camera]] \"left\"", "rate_hz", "what", "cure"};
    ranged.range = TomlRange{0.1, 1000};
    const json report = json::parse(daemon::to_json(
        {"a.toml", "a.toml.d/b.toml"}, {ranged, {{"a.toml"}, "", "", "empty", "fill it"}}));
    CHECK(report == json{{"file", "a.toml"},
                         {"files", {"a.toml", "a.toml.d/b.toml"}},
                         {"problems",
                          {{{"file", "a.toml.d/b.toml"},
                            {"line", 4},
                            {"column", 11},
                            {"table", "[[camera]] \"left\""},
                            {"key", "rate_hz"},
                            {"unit", "Hz"},
                            {"minimum", 0.1},
                            {"maximum", 1000.0},
                            {"what", "what"},
                            {"cure", "cure"}},
                           {{"file", "a.toml"}, {"what", "empty"}, {"cure", "fill it"}}}}});
}

TEST_CASE("problem_report: a file without problems, of any name") {
    const json report = json::parse(daemon::to_json({"a\xFF.toml"}, {}));
    CHECK(report["problems"] == json::array());
}
