// SPDX-License-Identifier: BSD-3-Clause
#include "pps_monitor.hpp"

#include <catch2/catch.hpp>

#include "nanoseconds.hpp"

using namespace versavis;
using namespace versavis::firmware;
using namespace versavis::test;

namespace {

/// A monitor that had pulses at `first`, and each `period` after it until `last`.
PpsMonitor with_pulses(Nanoseconds first, Nanoseconds last, Nanoseconds period = second) {
    PpsMonitor monitor;
    for (Nanoseconds at = first; at <= last; at += period) monitor.pulse(at);
    return monitor;
}

}  // namespace

TEST_CASE("pps_monitor: it trusts the fourth pulse, and reports no error before") {
    PpsMonitor monitor;
    CHECK(monitor.state(0) == wire::PpsState::none);
    for (int n = 0; n < 3; ++n) {
        const Nanoseconds at = n * (second + 7'000);
        monitor.pulse(at);
        CHECK(monitor.state(at) == wire::PpsState::acquiring);
        CHECK(monitor.error_ppb(at) == 0);
    }
    const Nanoseconds fourth = 3 * (second + 7'000);
    monitor.pulse(fourth);
    CHECK(monitor.state(fourth) == wire::PpsState::good);
    CHECK(monitor.error_ppb(fourth) == 7'000);
}

TEST_CASE("pps_monitor: ten seconds after the newest pulse nothing is known") {
    const PpsMonitor monitor = with_pulses(5 * second, 25 * second, second + 7'000);
    const Nanoseconds newest = 24 * second + 19 * 7'000;
    CHECK(monitor.state(newest + 10 * second) == wire::PpsState::good);
    CHECK(monitor.error_ppb(newest + 10 * second) == 7'000);
    CHECK(monitor.state(newest + 10 * second + 1) == wire::PpsState::none);
    CHECK(monitor.error_ppb(newest + 10 * second + 1) == 0);
}

TEST_CASE("pps_monitor: pulses are compared over ten seconds, and not over more") {
    const Nanoseconds longer = GENERATE(0, 1);
    PpsMonitor monitor = with_pulses(second, 5 * second);
    const Nanoseconds next = 15 * second + longer;
    monitor.pulse(next);
    CHECK(monitor.state(next) == (longer == 0 ? wire::PpsState::good : wire::PpsState::acquiring));
}

TEST_CASE("pps_monitor: pulses that are missing do not change the error") {
    PpsMonitor monitor;
    for (const Nanoseconds n : {0, 1, 4, 9, 10, 19}) monitor.pulse(77 + n * (second - 30'000));
    CHECK(monitor.error_ppb(20 * second) == -30'000);
}

TEST_CASE("pps_monitor: the error is the mean of 32 seconds") {
    PpsMonitor monitor;
    Nanoseconds at = second;
    for (int n = 0; n <= 40; ++n) monitor.pulse(at += second);
    for (int n = 1; n <= 40; ++n) {
        monitor.pulse(at += second + 3'200);
        REQUIRE(monitor.error_ppb(at) == (n < 32 ? 100 * n : 3'200));
    }
}

TEST_CASE("pps_monitor: a clock off by 200 ppm is measured, one off by more is not") {
    const Nanoseconds sign = GENERATE(1, -1);
    const Nanoseconds seconds = GENERATE(1, 9);
    const Nanoseconds furthest = seconds * (second + sign * 200'000);
    CAPTURE(sign, seconds);
    PpsMonitor measured;
    for (int n = 0; n < 4; ++n) measured.pulse(n * furthest);
    CHECK(measured.error_ppb(3 * furthest) == sign * 200'000);
    PpsMonitor refused;
    for (int n = 0; n < 3; ++n) refused.pulse(n * furthest);
    refused.pulse(3 * furthest + sign);
    CHECK(refused.state(3 * furthest) == wire::PpsState::acquiring);
}

TEST_CASE("pps_monitor: a pulse between two others is no part of them, however regular") {
    PpsMonitor monitor = with_pulses(0, 3 * second);
    for (Nanoseconds at = 4 * second; at < 60 * second; at += second) {
        monitor.pulse(at);
        monitor.pulse(at + 300'000'000);
        CHECK(monitor.state(at + 300'000'000) == wire::PpsState::good);
        CHECK(monitor.error_ppb(at) == 0);
    }
}

TEST_CASE("pps_monitor: a pulse that is reported twice counts once") {
    PpsMonitor monitor = with_pulses(0, 2 * second);
    monitor.pulse(2 * second);
    CHECK(monitor.state(2 * second) == wire::PpsState::acquiring);
}

TEST_CASE("pps_monitor: the third pulse of a new phase begins anew") {
    PpsMonitor monitor = with_pulses(0, 20 * second);
    const Nanoseconds phase = 20 * second + 400'000'000;
    for (int n = 1; n < 6; ++n) {
        const Nanoseconds at = phase + n * (second + 9'000);
        monitor.pulse(at);
        CHECK(monitor.state(at) == (n < 3 ? wire::PpsState::good : wire::PpsState::acquiring));
    }
    const Nanoseconds fourth = phase + 6 * (second + 9'000);
    monitor.pulse(fourth);
    CHECK(monitor.state(fourth) == wire::PpsState::good);
    CHECK(monitor.error_ppb(fourth) == 9'000);
}
