// SPDX-License-Identifier: BSD-3-Clause
#include "publish/exposure_completion.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr std::int64_t trigger_ns = 5'000'000'000;
constexpr std::int64_t start_ns = trigger_ns + 30'000;
constexpr std::int64_t end_ns = start_ns + 4'000'000;

CameraConfiguration completed_camera() {
    CameraConfiguration configuration;
    configuration.latency_us = 25;
    configuration.exposure_us = 3000;
    configuration.max_exposure_us = 20000;
    return configuration;
}

wire::Exposure record(std::int64_t start, std::int64_t end, std::uint16_t flags = 0) {
    wire::Exposure made{};
    made.trigger = 7;
    made.tick = 9;
    made.flags = flags;
    made.trigger_ns = trigger_ns;
    made.start_ns = start;
    made.end_ns = end;
    return made;
}

}  // namespace

TEST_CASE("exposure_completion: both edges of the camera's own line are a measurement") {
    ExposureCompletion completion(completed_camera());
    const auto exposure = completion.complete(record(start_ns, end_ns));
    CHECK(exposure.kind == StampKind::measured_middle);
    CHECK(exposure.trigger == 7);
    CHECK(exposure.tick == 9);
    CHECK(exposure.exposed);
    CHECK(middle(exposure.start, exposure.end).ns == start_ns + 2'000'000);
    CHECK(kind_sigma(exposure, milliseconds(9)).ns == 0);
}

TEST_CASE("exposure_completion: an end that was not seen lies between start and arrival") {
    ExposureCompletion completion(completed_camera());
    const auto exposure = completion.complete(record(start_ns, wire::no_time));
    CHECK(exposure.kind == StampKind::predicted_middle);
    CHECK(exposure.end - exposure.start == milliseconds(20));
    CHECK(kind_sigma(exposure, milliseconds(40)) == milliseconds(40));
    CHECK(kind_sigma(exposure, milliseconds(1)) > milliseconds(10));
}

TEST_CASE("exposure_completion: without any edge the trigger, its latency and history are left") {
    ExposureCompletion completion(completed_camera());
    const auto first = completion.complete(record(wire::no_time, wire::no_time));
    CHECK(first.kind == StampKind::trigger_edge);
    CHECK_FALSE(first.exposed);
    CHECK(first.start.ns == trigger_ns + 25'000);
    CHECK(first.end - first.start == milliseconds(3));
    completion.complete(record(start_ns, end_ns));
    const auto later = completion.complete(record(wire::no_time, wire::no_time));
    CHECK(later.end - later.start == milliseconds(4));
}

TEST_CASE("exposure_completion: edges of another line are not this camera's measurement") {
    for (const std::uint16_t flag : {wire::exposure_predicted, wire::exposure_from_master}) {
        ExposureCompletion completion(completed_camera());
        const auto made = record(start_ns, end_ns, flag);
        CHECK(measured(made));
        const auto exposure = completion.complete(made);
        CHECK(exposure.kind == StampKind::trigger_edge);
        CHECK(exposure.exposed);
    }
}

TEST_CASE("exposure_completion: no frame arrives before the end, if the end is known") {
    ExposureCompletion completion(completed_camera());
    const HostTime middle{100'000'000'000};
    const auto whole = record(start_ns, end_ns);
    auto exposure = completion.complete(whole);
    ExposureCompletion::place_on_host(exposure, whole, middle);
    CHECK(exposure.end_on_host == middle + milliseconds(2));
    CHECK(exposure.earliest_on_host == exposure.end_on_host);
    const auto endless = record(start_ns, wire::no_time);
    exposure = completion.complete(endless);
    ExposureCompletion::place_on_host(exposure, endless, middle);
    CHECK(exposure.end_on_host == middle + milliseconds(10));
    CHECK(exposure.earliest_on_host == middle - milliseconds(10));
}

TEST_CASE("exposure_completion: the delays of the lines are taken off start, end and middle") {
    ExposureCompletion completion(completed_camera());
    LineDelays lines;
    lines.trigger = {microseconds(18), microseconds(4)};
    lines.start = {microseconds(36), microseconds(9)};
    lines.end = {microseconds(12), microseconds(5)};
    completion.set_line_delays(lines);
    const auto whole = completion.complete(record(start_ns, end_ns));
    CHECK(whole.start.ns == start_ns - 36'000);
    CHECK(whole.end.ns == end_ns - 12'000);
    CHECK(whole.delay == microseconds(24));
    CHECK(kind_sigma(whole, milliseconds(9)) == microseconds(7));
    const auto endless = completion.complete(record(start_ns, wire::no_time));
    CHECK(endless.start.ns == start_ns - 36'000);
    CHECK(endless.end - endless.start == milliseconds(20));
    CHECK(endless.delay == microseconds(36));
    const auto unseen = completion.complete(record(wire::no_time, wire::no_time));
    CHECK(unseen.start.ns == trigger_ns + 18'000);
    CHECK(unseen.end - unseen.start == microseconds(4024));
    CHECK(unseen.delay.ns == 0);
}

TEST_CASE("exposure_completion: without a line of its own, an exposure begins a latency later") {
    ExposureCompletion completion(completed_camera());
    LineDelays lines;
    lines.trigger.delay = microseconds(18);
    lines.start.delay = lines.end.delay = microseconds(36);
    completion.set_line_delays(lines);
    // The board may have been given another latency than the camera turned out to have.
    const auto predicted = completion.complete(record(start_ns, end_ns, wire::exposure_predicted));
    CHECK(predicted.start.ns == trigger_ns + 18'000);
    CHECK(predicted.end - predicted.start == milliseconds(4));
    // Its master's line triggers it.
    const auto slave = completion.complete(record(start_ns, end_ns, wire::exposure_from_master));
    CHECK(slave.start.ns == start_ns + 18'000);
    CHECK(slave.end - slave.start == milliseconds(4));
}

TEST_CASE("exposure_completion: delays longer than the exposure leave its middle") {
    ExposureCompletion completion(completed_camera());
    LineDelays lines;
    lines.end.delay = microseconds(60);
    completion.set_line_delays(lines);
    const auto exposure = completion.complete(record(start_ns, start_ns + 40'000));
    CHECK(exposure.start == exposure.end);
    CHECK(exposure.start.ns == start_ns - 10'000);
}
