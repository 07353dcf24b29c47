// SPDX-License-Identifier: BSD-3-Clause
#include "pairing/evidence_json.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::client;
using nlohmann::json;

TEST_CASE("evidence_json: numbers that are not whole are refused, but for the rate of the grid") {
    json limits = to_json(pairing::RecordLimits{});
    limits["grid_slew_ppm"] = 0.5;
    CHECK(to_evidence(limits));
    for (const double number : {0.5, 2e19, -1e300}) {
        limits["latency_ns"] = number;
        const auto refused = to_evidence(limits);
        REQUIRE_FALSE(refused);
        CHECK_THAT(refused.error().what, Catch::Contains("'latency_ns' must be an integer"));
    }
    CHECK_FALSE(to_evidence(json{1, 2e19}));
    CHECK_FALSE(to_evidence(json(2e19)));
}
