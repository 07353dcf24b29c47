// SPDX-License-Identifier: BSD-3-Clause
#include "base/detached_tasks.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("detached_tasks: nobody waits longer than asked", "[threads]") {
    DetachedTasks patient;
    CHECK(patient.run([] {}, seconds(10)));
    CHECK(patient.unfinished() == 0);
    std::promise<void> device;
    std::promise<void> answered;
    auto answer = answered.get_future();
    CHECK_FALSE(patient.run(
        [future = device.get_future().share(), &answered] {
            future.wait();
            answered.set_value();
        },
        milliseconds(10)));
    CHECK(patient.unfinished() == 1);
    device.set_value();
    answer.wait();
}
