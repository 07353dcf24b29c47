// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_event.hpp"

#include <catch2/catch.hpp>
#include <set>
#include <string>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("board_event: each kind of the wire has one of its own in the ring") {
    std::set<EventKind> kinds;
    constexpr int kinds_on_the_wire = 18;
    for (int kind = 1; kind <= kinds_on_the_wire; ++kind) {
        wire::Event event{};
        event.kind = static_cast<wire::BoardEventKind>(kind);
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
    for (const int kind : {0, 19, 255}) {
        wire::Event event{};
        event.kind = static_cast<wire::BoardEventKind>(kind);
        CHECK_FALSE(journal_entry(event));
    }
}

TEST_CASE("board_event: a skipped trigger says why, and whose it is") {
    const auto reason = [](wire::SkipReason of) {
        wire::Event event{};
        event.kind = wire::BoardEventKind::trigger_skipped;
        event.detail = static_cast<std::uint16_t>(of);
        return journal_entry(event)->reason;
    };
    CHECK(reason(wire::SkipReason::busy) == EventReason::camera_busy);
    CHECK(reason(wire::SkipReason::late) == EventReason::too_late);
    CHECK(reason(wire::SkipReason::full) == EventReason::queue_full);
    CHECK(reason(static_cast<wire::SkipReason>(99)) == EventReason::none);
    CHECK(source_of(wire::BoardEventKind::trigger_skipped) == EventSource::camera);
    CHECK(source_of(wire::BoardEventKind::imu_silent) == EventSource::imu);
    CHECK(source_of(wire::BoardEventKind::pps) == EventSource::board);
}

TEST_CASE("board_event: a run of skipped triggers counts as that many") {
    wire::Event event{};
    event.kind = wire::BoardEventKind::triggers_skipped;
    event.source = 2;
    event.detail = 65535;
    event.value = 1000;
    CHECK(skipped_triggers(event) == 65535);
    const auto entry = journal_entry(event);
    CHECK(entry->kind == EventKind::triggers_skipped);
    CHECK(entry->reason == EventReason::too_late);
    CHECK(entry->count == 65535);
    CHECK(entry->value == 1000);
    CHECK(source_of(event.kind) == EventSource::camera);
    event.kind = wire::BoardEventKind::trigger_skipped;
    event.detail = static_cast<std::uint16_t>(wire::SkipReason::full);
    CHECK(skipped_triggers(event) == 1);
    CHECK(journal_entry(event)->count == 0);
    event.kind = wire::BoardEventKind::imu_failed;
    CHECK(skipped_triggers(event) == 0);
}

TEST_CASE("board_event: sync and storage are logged, with what to do") {
    using Kind = wire::BoardEventKind;
    const struct {
        Kind kind;
        std::int64_t value;
        LogLevel level;
        std::string text;
    } rows[]{{Kind::sync_lost, -1'234'567, LogLevel::warning,
              "a pulse at the sync input is -1234.567 us off the grid and was ignored: check the "
              "cable, and that 'sync_rate_hz' is the same as on the board that sends the pulses"},
             {Kind::sync_taken, -1'234'567, LogLevel::info,
              "the grid now follows the sync input and moves by -1234.567 us"},
             {Kind::stored, 1, LogLevel::info, "it stored its configuration"},
             {Kind::stored, 0, LogLevel::warning,
              "it could not store its configuration and will start with an older one at its next "
              "power-up: restart the service to try again, or set keep_configuration = false"}};
    wire::Event event{};
    for (const auto& [kind, value, level, text] : rows) {
        INFO(text);
        event.kind = kind;
        event.value = value;
        const auto logged = remark(event);
        REQUIRE(logged);
        CHECK(logged->level == level);
        CHECK(logged->text == text);
    }
    event.kind = wire::BoardEventKind::pps;
    CHECK_FALSE(remark(event));
}
