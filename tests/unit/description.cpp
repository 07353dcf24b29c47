// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description.hpp"

#include <catch2/catch.hpp>

using namespace versavis::daemon;

TEST_CASE("description: its place in the camera") {
    const auto place = parse_description_url("Local:GCAM_1.2.zip;8001C400;3E8?SchemaVersion=1.1");
    REQUIRE(place);
    CHECK(place->address == 0x8001C400);
    CHECK(place->size == 1000);
    CHECK(place->zipped);
    CHECK_FALSE(parse_description_url("local:a.xml;0;1")->zipped);
}

TEST_CASE("description: what is not in the camera, or has no bounds, is not asked for") {
    for (const char* url :
         {"", "File:///dev/zero", "http://192.168.0.1/x.xml", "Local:x.xml", "Local:x.xml;;",
          "Local:x.xml;10;0", "Local:x.xml;10;80000000", "Local:x.xml;10;8000000000000000",
          "Local:x.xml;10;fffffffffffffffff", "Local:x.xml;100000000;10", "Local:x.xml;-1;10"}) {
        CAPTURE(url);
        CHECK_FALSE(parse_description_url(url));
    }
}

TEST_CASE("description: each byte counts") {
    CHECK(hash_of({{1, 2, 3}, false}) != hash_of({{1, 2, 4}, false}));
    CHECK(hash_of({{1, 2, 3}, false}).size() == 64);
}
