// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/time.hpp"

#include <catch2/catch.hpp>
#include <ctime>

using namespace versavis;

namespace {

std::int64_t raw_ns() {
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC_RAW, &now);
    return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

}  // namespace

TEST_CASE("time: the host's clock is the raw one, in nanoseconds") {
    const std::int64_t before = raw_ns();
    const HostTime now = host_now();
    CHECK(now.ns >= before);
    CHECK(now.ns <= raw_ns());
}
