// SPDX-License-Identifier: BSD-3-Clause
#include "base/hal.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <iterator>

using namespace versavis::firmware;

namespace {

template <typename Array>
bool all_zero(const Array& values) {
    return std::all_of(std::begin(values), std::end(values), [](auto one) { return one == 0; });
}

}  // namespace

TEST_CASE("hal: signals have the numbers that every port wires") {
    CHECK(camera_count == 4);
    CHECK(output_light_gate == 4);
    CHECK(output_light_lead == 5);
    CHECK(output_sync == 6);
    CHECK(output_test == 7);
    CHECK(output_count == 8);
    CHECK(input_imu_ready == 4);
    CHECK(input_pulse == 6);
    CHECK(input_accel_ready == 10);
    CHECK(input_count == 11);
}

TEST_CASE("hal: data-ready lines are those of both IMUs and of an accelerometer of its own") {
    for (unsigned input = 0; input < 256; ++input)
        CHECK(is_data_ready(static_cast<std::uint8_t>(input)) ==
              (input == 4 || input == 5 || input == 10));
}

TEST_CASE("hal: sizes that a port makes room for") {
    CHECK(max_transfer == 40);
    CHECK(max_transfers == 3);
    CHECK(std::size(ImuImage().burst) == 13);
    CHECK(link_packet_size == 64);  // a bulk packet at full speed
}

TEST_CASE("hal: until something is said, nothing is routed or inverted") {
    const Routes routes;
    for (const std::uint8_t master : routes.master) CHECK(master == not_routed);
    CHECK(routes.inverted_triggers == 0);
    CHECK(routes.inverted_exposures == 0);
    CHECK(routes.light_cameras == 0);
    CHECK_FALSE(routes.light_inverted);
    CHECK(routes.light_limit == 0);
    CHECK(routes.test_input == not_routed);
    const Routing::Switched switched;
    CHECK(switched.at == never);
    CHECK(switched.clean);
}

TEST_CASE("hal: an empty job waits for nothing and transfers nothing") {
    const ImuJob job;
    CHECK(job.input == not_routed);
    CHECK(job.after == 0);
    CHECK(job.pause == 0);
    CHECK(job.count == 0);
    for (const ImuTransfer& transfer : job.transfers) {
        CHECK(transfer.bus == ImuTransfer::Bus::spi);
        CHECK(transfer.chip == 0);
        CHECK(transfer.size == 0);
        CHECK(transfer.clock_hz == 0);
        CHECK(transfer.word_gap_ns == 0);
        CHECK(all_zero(transfer.bytes));
    }
    const ImuReply reply;
    CHECK(reply.started == 0);
    CHECK(reply.ended == 0);
    CHECK_FALSE(reply.refused);
    CHECK(all_zero(reply.bytes));
    CHECK(ImuImage().product == 0);
    CHECK(all_zero(ImuImage().burst));
}

TEST_CASE("hal: a port has nothing, and words leave at any nanosecond, until it says otherwise") {
    PortFacts facts;
    CHECK(facts.present == 0);
    CHECK(facts.fastest_imu_millihertz == 0);
    CHECK(facts.output_grain() == 1);
    CHECK(facts.output_step == 1);
    facts.output_grain_bits = 3;
    CHECK(facts.output_grain() == 8);
}
