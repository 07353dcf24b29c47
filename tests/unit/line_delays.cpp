// SPDX-License-Identifier: BSD-3-Clause
#include "settings/line_delays.hpp"

#include <catch2/catch.hpp>

#include "settings/camera_preset.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

CameraPreset preset() {
    CameraPreset made;
    made.name = "maker";
    made.trigger_lines = {"In"};
    PresetLine input;
    input.name = "In";
    input.input_rising = EdgeDelay{microseconds(6), microseconds(1)};
    input.input_falling = EdgeDelay{microseconds(24), microseconds(4)};
    PresetLine output;
    output.name = "Out";
    output.output_rising = EdgeDelay{microseconds(36), microseconds(9)};
    output.output_falling = EdgeDelay{microseconds(12), microseconds(7)};
    PresetLine direct;
    direct.name = "Direct";
    direct.kind = LineKind::direct;
    made.lines = {input, output, direct};
    return made;
}

}  // namespace

TEST_CASE("line_delays: the edge that begins an exposure is the rising one, or the falling one") {
    CameraConfiguration camera;
    const LineDelays high = line_delays(preset(), camera, "In", "Out");
    CHECK(high.source == DelaySource::preset);
    CHECK(high.line == "Out");
    CHECK(high.start.delay == microseconds(36));
    CHECK(high.end.delay == microseconds(12));
    CHECK(middle_sigma(high) == microseconds(8));
    camera.strobe = Strobe::active_low;
    const LineDelays low = line_delays(preset(), camera, "In", "Out");
    CHECK(low.start.delay == microseconds(12));
    CHECK(low.end.delay == microseconds(36));
}

TEST_CASE("line_delays: the trigger's edge is the one that the camera takes") {
    CameraConfiguration camera;
    CHECK(line_delays(preset(), camera, "In", "Out").trigger.delay == microseconds(6));
    camera.trigger_inverted = true;
    CHECK(line_delays(preset(), camera, "In", "Out").trigger.delay == microseconds(24));
    camera.latency_us = 50;
    CHECK(line_delays(preset(), camera, "In", "Out").trigger.delay == microseconds(50));
}

TEST_CASE("line_delays: the configuration wins, and the board's own parts come on top") {
    CameraConfiguration camera;
    camera.strobe_rising_us = {20, 2};
    camera.strobe_falling_us = {10, 1};
    camera.board_input_ns = 60;
    camera.board_output_ns = 40;
    const LineDelays delays = line_delays(preset(), camera, "In", "Out");
    CHECK(delays.source == DelaySource::configuration);
    CHECK(delays.start.delay == nanoseconds(20'060));
    CHECK(delays.end.delay == nanoseconds(10'060));
    CHECK(delays.trigger.delay == nanoseconds(6'040));
    CHECK(middle_sigma(delays) == nanoseconds(1'500));
}

TEST_CASE("line_delays: of a line that nobody knows nothing is taken off, and sigma says so") {
    const LineDelays other = line_delays(preset(), {}, "Other", "Other");
    CHECK(other.source == DelaySource::unknown);
    CHECK(other.start.delay.ns == 0);
    CHECK(middle_sigma(other) >= microseconds(30));
    const LineDelays direct = line_delays(preset(), {}, "Direct", "Direct");
    CHECK(direct.source == DelaySource::unknown);
    CHECK(middle_sigma(direct) < microseconds(5));
    CHECK(middle_sigma(direct).ns > 0);
}

TEST_CASE("line_delays: a preset that is named gives its latency before the camera is there") {
    CameraConfiguration camera;
    use_named_preset({preset()}, camera);
    CHECK(camera.latency_us == 0);
    camera.preset = "maker";
    use_named_preset({preset()}, camera);
    CHECK(camera.latency_us == 6);
    camera.latency_us = 15;
    use_named_preset({preset()}, camera);
    CHECK(camera.latency_us == 15);
}
