// SPDX-License-Identifier: BSD-3-Clause
#include "stamp_guard.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using daemon::StampGuard;

namespace {

clock::Stamp stamp(std::int64_t ns, std::uint32_t epoch,
                   clock::ClockState state = clock::ClockState::locked) {
    clock::Stamp stamp;
    stamp.output = {ns};
    stamp.epoch = epoch;
    stamp.state = state;
    return stamp;
}

}  // namespace

TEST_CASE("stamp_guard: stamps never go backwards within an epoch, and say when they were held") {
    StampGuard guard;
    std::uint32_t flags = 0;
    CHECK(guard.guard(stamp(100, 1), flags).ns == 100);
    CHECK(flags == 0);
    CHECK(guard.guard(stamp(90, 1), flags).ns == 101);
    CHECK(flags == flag_clamped);
    flags = 0;
    CHECK(guard.guard(stamp(50, 2), flags).ns == 50);
    CHECK(flags == 0);
    CHECK(guard.guard(stamp(60, 2, clock::ClockState::holdover), flags).ns == 60);
    CHECK(flags == flag_holdover);
}
