// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_view.hpp"

#include <catch2/catch.hpp>

using namespace versavis::client;
using Catch::Contains;
using nlohmann::json;

TEST_CASE("status_view: each fact of the clock has a name and a unit") {
    const std::string text =
        clock_text(json::parse(R"({"board": {"pps": "good", "pps_error_ppb": -120},
        "clock": {"state": "locked", "output": "tai", "sigma_ns": 4500, "skew_ppm": -12.34567,
                  "output_minus_host_ns": 1700000000000000000, "exchanges": 17}})"));
    CHECK_THAT(text, Contains("state                locked\n"));
    CHECK_THAT(text, Contains("sigma                4.5 us "));
    CHECK_THAT(text, Contains("-12.3457 ppm"));
    CHECK_THAT(text, Contains("1700000000.000000 s"));
    CHECK_THAT(text, Contains("exchanges            17 "));
    CHECK_THAT(text, Contains("board against PPS    -120 ppb"));
}

TEST_CASE("status_view: keys of the clock that are not known yet are shown by their names") {
    const std::string text = clock_text(
        json::parse(R"({"clock": {"later": {"residual_ns": -250, "state": "good"}, "other_ns": 2500,
                                  "since_then_s": 0.25, "really": true, "label": null}})"));
    CHECK_THAT(text,
               Contains("later.residual_ns    -0.2") && Contains("later.state          good\n"));
    CHECK_THAT(text, Contains("other_ns             2.5 us\n"));
    CHECK_THAT(text,
               Contains("since_then_s         0.2 s\n") && Contains("really               true\n"));
    CHECK(clock_text(json::object()).empty());
}
