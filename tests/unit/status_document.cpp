// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_document.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using client::why_silent;

TEST_CASE("status_document: what a service waits for is what systemd has of it") {
    const auto why = why_silent(
        "Id=versavisd.service\nActiveState=inactive\nStatusText=\n\n"
        "Id=versavisd@left.service\nActiveState=active\nStatusText=ok\n\n"
        "Id=versavisd@right.service\nActiveState=active\nStatusText=waiting: a=b: no memory; "
        "enlarge it\n");
    REQUIRE(why);
    CHECK(why->message() ==
          "versavisd@right.service: waiting: a=b: no memory; enlarge it; see 'journalctl -u "
          "versavisd@right.service'");
}

TEST_CASE("status_document: a service that failed is named, one that waits before it") {
    const std::string failed = "Id=versavisd.service\nActiveState=failed\nStatusText=waiting: x\n";
    CHECK(why_silent(failed)->what == "it has failed");
    const std::string waits = "\nId=versavisd@a.service\nActiveState=active\nStatusText=waiting: x";
    CHECK(why_silent(failed + waits)->where == "versavisd@a.service");
}

TEST_CASE("status_document: systemd knows nothing of a service that runs otherwise") {
    CHECK_FALSE(why_silent(""));
    CHECK_FALSE(why_silent("Id=versavisd.service\nActiveState=inactive\nStatusText=\n"));
    CHECK_FALSE(why_silent("System has not been booted with systemd as init system\n"));
}
