// SPDX-License-Identifier: BSD-3-Clause
#include "configuration/board_configuration.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

wire::Refusal refusal(wire::ConfigurationPart part, wire::ConfigurationField field) {
    wire::Refusal made{};
    made.part = part;
    made.field = field;
    made.index = 2;
    made.value = 70;
    made.minimum = 10;
    made.maximum = 60;
    return made;
}

}  // namespace

TEST_CASE("board_configuration: a refusal names key, table, value and range") {
    using Field = wire::ConfigurationField;
    using Part = wire::ConfigurationPart;
    const std::string camera = describe(refusal(Part::camera, Field::pulse));
    for (const char* part : {"'pulse_us'", "camera at output 2", "70", "10 to 60", "ns"})
        CHECK_THAT(camera, Catch::Contains(part));
    CHECK_THAT(describe(refusal(Part::imu, Field::imu_kind)), Catch::Contains("IMU at port 2"));
    CHECK_THAT(describe(refusal(Part::ports, Field::test)), Catch::Contains("[ports]"));
    CHECK_THAT(describe(refusal(Part::illumination, Field::lead)),
               Catch::Contains("[illumination]"));
}

TEST_CASE("board_configuration: each field that a board can refuse has a key") {
    for (int field = 1; field <= 21; ++field)
        CHECK_THAT(describe(refusal(wire::ConfigurationPart::camera,
                                    static_cast<wire::ConfigurationField>(field))),
                   !Catch::Contains("unknown field"));
    CHECK_THAT(describe(refusal(wire::ConfigurationPart::camera,
                                static_cast<wire::ConfigurationField>(250))),
               Catch::Contains("unknown field"));
}
