// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/strobe_witness.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr HostTime first_start{7'000'000'000};
constexpr Duration frame_period = milliseconds(50);

clock::HostEstimate start_at(int number, Duration off = {}) {
    return {first_start + frame_period * number + off, microseconds(5), microseconds(40), {}, {}};
}

}  // namespace

TEST_CASE("strobe_witness: starts are compared in whatever order they come") {
    StrobeWitness witness(frame_period, {});
    witness.started(start_at(0, microseconds(12)));
    CHECK(witness.report().compared == 0);
    witness.rose(start_at(0));
    CHECK(witness.report().compared == 1);
    CHECK(witness.report().error == microseconds(12));
    witness.rose(start_at(1));
    witness.rose(start_at(2));
    witness.started(start_at(1, microseconds(-7)));
    CHECK(witness.report().error == microseconds(-7));
    witness.started(start_at(2, microseconds(3)));
    CHECK(witness.report().error == microseconds(3));
    CHECK(witness.report().compared == 3);
    CHECK(witness.report().contradicting == 0);
}

TEST_CASE("strobe_witness: three in a row beyond both bounds contradict, and one takes that back") {
    StrobeWitness witness(frame_period, microseconds(10));
    const auto compare = [&](int number, Duration off) {
        witness.rose(start_at(number));
        witness.started(start_at(number, off));
    };
    for (int i = 0; i < 5; ++i) compare(i, microseconds(110));  // within 40 + 40 + 33
    CHECK(witness.report().contradicting == 0);
    compare(5, microseconds(-120));
    compare(6, microseconds(120));
    CHECK_FALSE(witness.contradicts(start_at(10).time));
    compare(7, milliseconds(3));
    CHECK(witness.contradicts(start_at(10).time));
    compare(8, milliseconds(3));
    CHECK(witness.contradicts(start_at(10).time));
    CHECK_FALSE(witness.contradicts(start_at(8).time + seconds(11)));  // the line shows no more
    compare(9, {});
    CHECK_FALSE(witness.contradicts(start_at(10).time));
}

TEST_CASE("strobe_witness: what one side alone saw is forgotten, and compared with nothing else") {
    StrobeWitness witness(frame_period, {});
    for (int i = 0; i < 1000; ++i) witness.rose(start_at(i));  // frames are lost
    CHECK(witness.report().compared == 0);
    witness.started(start_at(3));
    CHECK(witness.report().compared == 0);
    witness.started(start_at(999));
    CHECK(witness.report().compared == 1);
    CHECK(witness.report().error == Duration{});
}
