// SPDX-License-Identifier: BSD-3-Clause
#include "base/patient_work.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("patient_work: nobody waits longer than asked", "[threads]") {
    PatientWork patient;
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
