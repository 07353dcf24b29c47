// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/metadata.hpp"

namespace versavis {

const char* to_string(StampKind kind) {
    switch (kind) {
        case StampKind::measured_middle: return "measured";
        case StampKind::predicted_middle: return "predicted";
        case StampKind::trigger_edge: return "trigger";
        case StampKind::arrival: return "arrival";
        case StampKind::camera_ptp: return "ptp";
    }
    return "unknown";
}

const char* to_string(EventKind kind) {
    switch (kind) {
        case EventKind::trigger_without_frame: return "trigger_without_frame";
        case EventKind::frame_without_trigger: return "frame_without_trigger";
        case EventKind::trigger_skipped: return "trigger_skipped";
        case EventKind::stray_edge: return "stray_edge";
        case EventKind::output_late: return "output_late";
        case EventKind::board_connected: return "board_connected";
        case EventKind::board_lost: return "board_lost";
        case EventKind::camera_connected: return "camera_connected";
        case EventKind::camera_lost: return "camera_lost";
        case EventKind::pairing_locked: return "pairing_locked";
        case EventKind::pairing_slipped: return "pairing_slipped";
        case EventKind::edge_overflow: return "edge_overflow";
        case EventKind::pps: return "pps";
        case EventKind::aux_pulse: return "aux_pulse";
        case EventKind::sync_pulse: return "sync_pulse";
        case EventKind::input_noisy: return "input_noisy";
        case EventKind::illumination_limited: return "illumination_limited";
        case EventKind::imu_ready: return "imu_ready";
        case EventKind::imu_failed: return "imu_failed";
        case EventKind::imu_silent: return "imu_silent";
        case EventKind::utc_label: return "utc_label";
        case EventKind::message_doubted: return "message_doubted";
        case EventKind::stream_stepped: return "stream_stepped";
        case EventKind::output_clock_stepped: return "output_clock_stepped";
        case EventKind::triggers_skipped: return "triggers_skipped";
        case EventKind::sync_lost: return "sync_lost";
        case EventKind::sync_taken: return "sync_taken";
        case EventKind::configuration_stored: return "configuration_stored";
        case EventKind::seconds_differ: return "seconds_differ";
        case EventKind::host_undisciplined: return "host_undisciplined";
        case EventKind::time_pulse: return "time_pulse";
    }
    return "unknown";
}

const char* to_string(EventReason reason) {
    switch (reason) {
        case EventReason::none: return "none";
        case EventReason::frame_incomplete: return "frame_incomplete";
        case EventReason::frame_missing: return "frame_missing";
        case EventReason::exposure_missing: return "exposure_missing";
        case EventReason::unproved: return "unproved";
        case EventReason::mismatch: return "mismatch";
        case EventReason::no_clock: return "no_clock";
        case EventReason::wrong_size: return "wrong_size";
        case EventReason::reset: return "reset";
        case EventReason::trigger_ignored: return "trigger_ignored";
        case EventReason::camera_busy: return "camera_busy";
        case EventReason::too_late: return "too_late";
        case EventReason::queue_full: return "queue_full";
        case EventReason::out_of_order: return "out_of_order";
        case EventReason::no_buffer: return "no_buffer";
        case EventReason::camera_silent: return "camera_silent";
        case EventReason::wrong_exposure: return "wrong_exposure";
        case EventReason::implausible_number: return "implausible_number";
        case EventReason::implausible_time: return "implausible_time";
        case EventReason::implausible_length: return "implausible_length";
        case EventReason::implausible_flags: return "implausible_flags";
        case EventReason::not_yet: return "not_yet";
        case EventReason::too_old: return "too_old";
        case EventReason::went_back: return "went_back";
    }
    return "unknown";
}

}  // namespace versavis
