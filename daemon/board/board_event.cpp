// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_event.hpp"

#include <fmt/format.h>

namespace versavis::daemon {

namespace {

std::optional<EventKind> event_kind(wire::EventKind kind) {
    switch (kind) {
        case wire::EventKind::trigger_skipped: return EventKind::trigger_skipped;
        case wire::EventKind::stray_edge: return EventKind::stray_edge;
        case wire::EventKind::output_late: return EventKind::output_late;
        case wire::EventKind::edge_overflow: return EventKind::edge_overflow;
        case wire::EventKind::pps: return EventKind::pps;
        case wire::EventKind::aux_pulse: return EventKind::aux_pulse;
        case wire::EventKind::sync_pulse: return EventKind::sync_pulse;
        case wire::EventKind::input_noisy: return EventKind::input_noisy;
        case wire::EventKind::illumination_limited: return EventKind::illumination_limited;
        case wire::EventKind::imu_ready: return EventKind::imu_ready;
        case wire::EventKind::imu_failed: return EventKind::imu_failed;
        case wire::EventKind::imu_silent: return EventKind::imu_silent;
        case wire::EventKind::utc_label: return EventKind::utc_label;
        case wire::EventKind::triggers_skipped: return EventKind::triggers_skipped;
        case wire::EventKind::sync_lost: return EventKind::sync_lost;
        case wire::EventKind::sync_taken: return EventKind::sync_taken;
        case wire::EventKind::stored: return EventKind::configuration_stored;
    }
    return std::nullopt;
}

EventReason skip_reason(std::uint16_t detail) {
    switch (static_cast<wire::SkipReason>(detail)) {
        case wire::SkipReason::busy: return EventReason::camera_busy;
        case wire::SkipReason::late: return EventReason::too_late;
        case wire::SkipReason::full: return EventReason::queue_full;
    }
    return EventReason::none;
}

}  // namespace

EventSource source_of(wire::EventKind kind) {
    switch (kind) {
        case wire::EventKind::trigger_skipped:
        case wire::EventKind::triggers_skipped:
        case wire::EventKind::stray_edge: return EventSource::camera;
        case wire::EventKind::imu_ready:
        case wire::EventKind::imu_failed:
        case wire::EventKind::imu_silent: return EventSource::imu;
        default: return EventSource::board;
    }
}

std::uint64_t skipped_triggers(const wire::Event& event) {
    if (event.kind == wire::EventKind::trigger_skipped) return 1;
    return event.kind == wire::EventKind::triggers_skipped ? event.detail : 0;
}

std::optional<BoardRemark> remark(const wire::Event& event) {
    const double us = static_cast<double>(event.value) * 1e-3;
    switch (event.kind) {
        case wire::EventKind::sync_lost:
            return BoardRemark{
                LogLevel::warning,
                fmt::format("a pulse of the sync input is {:.3f} us off the grid, which does not "
                            "follow it: check its cable, and that 'sync_rate_hz' is that of the "
                            "board which sends the pulses",
                            us)};
        case wire::EventKind::sync_taken:
            return BoardRemark{
                LogLevel::info,
                fmt::format("the grid follows the pulses of the sync input, and moves by {:.3f} us "
                            "for that",
                            us)};
        case wire::EventKind::stored:
            if (event.value != 0) return BoardRemark{LogLevel::info, "it keeps its configuration"};
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
    if (event.kind == wire::EventKind::trigger_skipped) entry.reason = skip_reason(event.detail);
    if (event.kind == wire::EventKind::triggers_skipped) {
        entry.reason = EventReason::too_late;
        entry.count = event.detail;
    }
    return entry;
}

}  // namespace versavis::daemon
