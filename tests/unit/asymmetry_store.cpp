// SPDX-License-Identifier: BSD-3-Clause
#include "board/asymmetry_store.hpp"

#include <catch2/catch.hpp>
#include <fstream>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using versavis::daemon::AsymmetryStore;

TEST_CASE("asymmetry_store: each port has its own, with a larger sigma another day") {
    test::TemporaryDirectory directory;
    const AsymmetryStore store(directory.path());
    CHECK_FALSE(*store.load("usb:1-2"));
    REQUIRE(store.save("usb:1-2", {microseconds(31), microseconds(2)}));
    REQUIRE(store.save("usb:1-3", {-microseconds(5), microseconds(1)}));
    const AsymmetryStore later(directory.path());
    const auto first = *later.load("usb:1-2");
    REQUIRE(first);
    CHECK(first->offset == microseconds(31));
    CHECK(first->sigma > microseconds(2));
    CHECK((*later.load("usb:1-3"))->offset == -microseconds(5));
    CHECK_FALSE(*later.load("usb:1-4"));
}

TEST_CASE("asymmetry_store: a file that is none names itself and the cure") {
    test::TemporaryDirectory directory;
    const AsymmetryStore store(directory.path());
    for (const char* text :
         {"[1, 2]", "{\"p\": 3}", "{\"p\": {\"offset_ns\": \"x\", \"sigma_ns\": 1}}",
          "{\"p\": {\"offset_ns\": 1e300, \"sigma_ns\": 1}}", "not json", ""}) {
        std::ofstream(store.path()) << text;
        const auto loaded = store.load("p");
        REQUIRE_FALSE(loaded);
        CHECK_THAT(loaded.error().message(),
                   Catch::Contains("asymmetry.json") && Catch::Contains("remove it"));
    }
    REQUIRE(store.save("p", {microseconds(1), microseconds(1)}));
    CHECK(*store.load("p"));
}

TEST_CASE("asymmetry_store: nowhere to write is an error with a cure") {
    const auto saved = AsymmetryStore("/nowhere").save("p", {});
    REQUIRE_FALSE(saved);
    CHECK_THAT(saved.error().message(), Catch::Contains("state_directory"));
}
