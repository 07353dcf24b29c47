// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_event.hpp"

#include <catch2/catch.hpp>
#include <set>
#include <string>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("board_event: each kind of the wire has one of its own in the ring") {
    std::set<EventKind> kinds;
    constexpr int kinds_on_the_wire = 17;
    for (int kind = 1; kind <= kinds_on_the_wire; ++kind) {
        wire::Event event{};
        event.kind = static_cast<wire::EventKind>(kind);
        event.source = 2;
        event.value = 77;
        event.time_ns = 5;
        const auto entry = journal_entry(event);
        REQUIRE(entry);
        CHECK(to_string(entry->kind) != std::string("unknown"));
        CHECK(entry->source == 2);
        CHECK(entry->source_name == "board");
        CHECK(entry->value == 77);
        CHECK(entry->board_time->ns == 5);
        kinds.insert(entry->kind);
    }
    CHECK(kinds.size() == kinds_on_the_wire);
}

TEST_CASE("board_event: what only a newer board knows is nothing") {
    for (const int kind : {0, 18, 255}) {
        wire::Event event{};
        event.kind = static_cast<wire::EventKind>(kind);
        CHECK_FALSE(journal_entry(event));
    }
}

TEST_CASE("board_event: a skipped trigger says why, and whose it is") {
    const auto reason = [](wire::SkipReason of) {
        wire::Event event{};
        event.kind = wire::EventKind::trigger_skipped;
        event.detail = static_cast<std::uint16_t>(of);
        return journal_entry(event)->reason;
    };
    CHECK(reason(wire::SkipReason::busy) == EventReason::camera_busy);
    CHECK(reason(wire::SkipReason::late) == EventReason::too_late);
    CHECK(reason(wire::SkipReason::full) == EventReason::queue_full);
    CHECK(reason(static_cast<wire::SkipReason>(99)) == EventReason::none);
    CHECK(source_of(wire::EventKind::trigger_skipped) == EventSource::camera);
    CHECK(source_of(wire::EventKind::imu_silent) == EventSource::imu);
    CHECK(source_of(wire::EventKind::pps) == EventSource::board);
}
