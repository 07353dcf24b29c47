// SPDX-License-Identifier: BSD-3-Clause
#include "plausibility/reported_exposure.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr HostTime first_report{100'000'000'000};
constexpr Duration settling = milliseconds(100);

}  // namespace

TEST_CASE("reported_exposure: nothing is known before a report has settled") {
    ReportedExposure reported(settling);
    CHECK_FALSE(reported.at(first_report));
    reported.add(milliseconds(3), first_report);
    CHECK_FALSE(reported.at(first_report + settling));
    const auto range = reported.at(first_report + settling + nanoseconds(1));
    REQUIRE(range);
    CHECK(range->shortest == milliseconds(3));
    CHECK(range->width().ns == 0);
}

TEST_CASE("reported_exposure: old and new value may both hold while a report settles") {
    ReportedExposure reported(settling);
    reported.add(milliseconds(3), {});
    reported.add(milliseconds(5), first_report);
    reported.add(milliseconds(4), first_report + milliseconds(10));
    const auto range = reported.at(first_report + milliseconds(50));
    REQUIRE(range);
    CHECK(range->shortest == milliseconds(3));
    CHECK(range->longest == milliseconds(5));
    CHECK(reported.at(first_report + milliseconds(105))->shortest == milliseconds(4));
    CHECK(reported.at(first_report + milliseconds(111))->width().ns == 0);
    reported.add({}, first_report + milliseconds(200));
    CHECK_FALSE(reported.at(first_report + seconds(10)));
    reported.clear();
    CHECK_FALSE(reported.at(first_report + seconds(20)));
}

TEST_CASE("reported_exposure: more reports than it keeps widen the range, and hide none") {
    ReportedExposure reported(settling);
    reported.add(milliseconds(3), {});
    reported.add(milliseconds(9), first_report);
    for (int i = 1; i <= 200; ++i) reported.add(milliseconds(4), first_report + microseconds(i));
    const auto range = reported.at(first_report + microseconds(300));
    REQUIRE(range);
    CHECK(range->shortest == milliseconds(3));
    CHECK(range->longest == milliseconds(9));
}
