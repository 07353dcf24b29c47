// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/segment_lifecycle.hpp"

#include <catch2/catch.hpp>

#include "../support/sleepers.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

struct Ended {
    Header header{};

    WriterState state() const { return static_cast<WriterState>(header.state.load()); }
};

}  // namespace

TEST_CASE_METHOD(Ended,
                 "ending: who is superseded, or is not after all, has readers that sleep on") {
    const test::Sleepers readers(header.wake, 3);
    supersede(header);
    CHECK(state() == WriterState::superseded);
    reinstate(header);
    CHECK(state() == WriterState::live);
    CHECK(header.wake == 0);
    CHECK(readers.asleep() == 3);
}

TEST_CASE_METHOD(Ended,
                 "segment_lifecycle: all readers are woken, and those about to sleep do not") {
    const bool ends = GENERATE(true, false);
    reinstate(header);
    const test::Sleepers readers(header.wake, 3);
    if (ends)
        end(header);
    else
        wake_readers(header);
    readers.wait_until_all_are_woken();
    CHECK(header.wake != 0);
    CHECK(state() == (ends ? WriterState::closed : WriterState::live));
}
