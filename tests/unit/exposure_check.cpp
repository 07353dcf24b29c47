// SPDX-License-Identifier: BSD-3-Clause
#include "stream/exposure_check.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr HostTime begin{100'000'000'000};

CameraConfiguration camera(bool check = true) {
    CameraConfiguration configuration;
    configuration.rate_hz = 20;
    configuration.check_exposure = check;
    return configuration;
}

pairing::Exposure exposure(Duration length, HostTime at = begin + seconds(10)) {
    pairing::Exposure made;
    made.end = made.start + length;
    made.end_on_host = at;
    made.earliest_on_host = at;
    return made;
}

}  // namespace

TEST_CASE("exposure_check: a twentieth, or 200 us, of difference is none") {
    ExposureCheck check(camera());
    check.set_camera_exposure(milliseconds(2), begin);
    CHECK_FALSE(check.contradicts({}, exposure(microseconds(2190))));
    CHECK(check.contradicts({}, exposure(microseconds(2210))));
    check.set_camera_exposure(milliseconds(19), begin);
    CHECK_FALSE(check.contradicts({}, exposure(microseconds(19990))));
    CHECK(check.contradicts({}, exposure(microseconds(20100))));
    CHECK(check.contradicted());
    CHECK(check.measured() == microseconds(20100));
    CHECK(check.told() == milliseconds(19));
}

TEST_CASE("exposure_check: a new exposure is given time to hold, one in the frame's data is not") {
    ExposureCheck check(camera());
    check.set_camera_exposure(milliseconds(2), begin);
    // Half a second and five periods of 50 ms.
    CHECK_FALSE(check.contradicts({}, exposure(milliseconds(9), begin + milliseconds(750))));
    CHECK(check.contradicts({}, exposure(milliseconds(9), begin + milliseconds(751))));
    check.set_camera_exposure(milliseconds(2), {});  // before the first frame
    CHECK(check.contradicts({}, exposure(milliseconds(9), begin)));
    check.set_camera_exposure(milliseconds(2), begin);
    pairing::Arrival with_chunk;
    with_chunk.exposure = milliseconds(2);
    CHECK(check.contradicts(with_chunk, exposure(milliseconds(9), begin)));
}

TEST_CASE("exposure_check: nothing to hold it against, or not wanted, is no contradiction") {
    ExposureCheck ignorant(camera());
    CHECK_FALSE(ignorant.contradicts({}, exposure(milliseconds(9))));
    ExposureCheck unwanted(camera(false));
    unwanted.set_camera_exposure(milliseconds(2), begin);
    CHECK_FALSE(unwanted.contradicts({}, exposure(milliseconds(9))));
    ExposureCheck check(camera());
    check.set_camera_exposure(milliseconds(2), begin);
    auto predicted = exposure(milliseconds(9));
    predicted.kind = StampKind::predicted_middle;
    CHECK_FALSE(check.contradicts({}, predicted));
}
