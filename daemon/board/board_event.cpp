// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_event.hpp"

#include <fmt/format.h>

namespace versavis::daemon {

namespace {

/// The compiler warns of a kind that is missing here.
constexpr std::optional<EventKind> event_kind(wire::BoardEventKind kind) {
    switch (kind) {
        case wire::BoardEventKind::trigger_skipped: return EventKind::trigger_skipped;
        case wire::BoardEventKind::stray_edge: return EventKind::stray_edge;
        case wire::BoardEventKind::output_late: return EventKind::output_late;
        case wire::BoardEventKind::edge_overflow: return EventKind::edge_overflow;
        case wire::BoardEventKind::pps: return EventKind::pps;
        case wire::BoardEventKind::aux_pulse: return EventKind::aux_pulse;
        case wire::BoardEventKind::sync_pulse: return EventKind::sync_pulse;
        case wire::BoardEventKind::input_noisy: return EventKind::input_noisy;
        case wire::BoardEventKind::illumination_limited: return EventKind::illumination_limited;
        case wire::BoardEventKind::imu_ready: return EventKind::imu_ready;
        case wire::BoardEventKind::imu_failed: return EventKind::imu_failed;
        case wire::BoardEventKind::imu_silent: return EventKind::imu_silent;
        case wire::BoardEventKind::utc_label: return EventKind::utc_label;
        case wire::BoardEventKind::triggers_skipped: return EventKind::triggers_skipped;
        case wire::BoardEventKind::sync_lost: return EventKind::sync_lost;
        case wire::BoardEventKind::sync_taken: return EventKind::sync_taken;
        case wire::BoardEventKind::stored: return EventKind::configuration_stored;
        case wire::BoardEventKind::time_pulse: return EventKind::time_pulse;
    }
    return std::nullopt;
}

constexpr bool each_has_its_own() {
    constexpr unsigned codes = 256;
    for (unsigned a = 0; a < codes; ++a)
        for (unsigned b = 0; b < a; ++b) {
            const auto kind = event_kind(static_cast<wire::BoardEventKind>(a));
            if (kind && kind == event_kind(static_cast<wire::BoardEventKind>(b))) return false;
        }
    return true;
}
static_assert(each_has_its_own(), "two kinds of the board have one in the ring");

EventReason skip_reason(std::uint16_t detail) {
    switch (static_cast<wire::SkipReason>(detail)) {
        case wire::SkipReason::busy: return EventReason::camera_busy;
        case wire::SkipReason::late: return EventReason::too_late;
        case wire::SkipReason::full: return EventReason::queue_full;
    }
    return EventReason::none;
}

}  // namespace

EventSource source_of(wire::BoardEventKind kind) {
    switch (kind) {
        case wire::BoardEventKind::trigger_skipped:
        case wire::BoardEventKind::triggers_skipped:
        case wire::BoardEventKind::stray_edge: return EventSource::camera;
        case wire::BoardEventKind::imu_ready:
        case wire::BoardEventKind::imu_failed:
        case wire::BoardEventKind::imu_silent: return EventSource::imu;
        default: return EventSource::board;
    }
}

std::uint64_t skipped_triggers(const wire::Event& event) {
    if (event.kind == wire::BoardEventKind::trigger_skipped) return 1;
    return event.kind == wire::BoardEventKind::triggers_skipped ? event.detail : 0;
}

std::optional<BoardRemark> remark(const wire::Event& event) {
    const double us = static_cast<double>(event.value) * 1e-3;
    switch (event.kind) {
        case wire::BoardEventKind::sync_lost:
            return BoardRemark{
                LogLevel::warning,
                fmt::format("a pulse at the sync input is {:.3f} us off the grid and was ignored: "
                            "check the cable, and that 'sync_rate_hz' is the same as on the board "
                            "that sends the pulses",
                            us)};
        case wire::BoardEventKind::sync_taken:
            return BoardRemark{
                LogLevel::info,
                fmt::format("the grid now follows the sync input and moves by {:.3f} us", us)};
        case wire::BoardEventKind::stored:
            if (event.value != 0) return BoardRemark{LogLevel::info, "it stored its configuration"};
            return BoardRemark{LogLevel::warning, unkept_configuration};
        default: return std::nullopt;
    }
}

std::optional<JournalEntry> journal_entry(const wire::Event& event) {
    const auto kind = event_kind(event.kind);
    if (!kind) return std::nullopt;
    JournalEntry entry;
    entry.kind = *kind;
    entry.source = event.source;
    entry.source_name = "board";
    entry.value = event.value;
    entry.board_time = BoardTime{event.time_ns};
    if (event.kind == wire::BoardEventKind::trigger_skipped)
        entry.reason = skip_reason(event.detail);
    if (event.kind == wire::BoardEventKind::triggers_skipped) {
        entry.reason = EventReason::too_late;
        entry.count = event.detail;
    }
    return entry;
}

}  // namespace versavis::daemon
