// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/event_lengths.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("event_lengths: from the start to the end of the same frame, once both are known") {
    EventLengths lengths;
    lengths.started(7, {1000});
    CHECK(lengths.length(7).ns == 0);
    lengths.ended(7, {4000});
    CHECK(lengths.length(7).ns == 3000);
    CHECK(lengths.length(8).ns == 0);
    lengths.ended(9, {5000});
    CHECK(lengths.length(9).ns == 0);
    lengths.started(10, {6000});
    lengths.ended(10, {5000});
    CHECK(lengths.length(10).ns == 0);
}

TEST_CASE("event_lengths: ids of 16 bits are those of frames whose ids were unwrapped") {
    EventLengths lengths;
    lengths.started(5, {1000});
    lengths.ended(5, {4000});
    CHECK(lengths.length(65535 + 5).ns == 3000);
    CHECK(lengths.length(65536 + 5).ns == 0);
    // One that comes again counts anew.
    lengths.started(5 + 64, {9000});
    CHECK(lengths.length(5).ns == 0);
}
