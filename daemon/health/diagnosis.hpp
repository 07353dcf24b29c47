// SPDX-License-Identifier: BSD-3-Clause
// What is wrong with a device, as its cause and what to do: rules in order of cause, from reports.
#pragma once

#include <string>
#include <vector>

#include "pipeline/imu_pipeline.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

struct Status;
struct CameraStatus;
struct ImuStatus;
struct LidarStatus;
struct TimeOutputStatus;

enum class Health {
    ok,
    starting,  ///< it has not delivered yet, and was not given its time
    degraded,
};
const char* to_string(Health health);

/// docs/user/troubleshooting.md has a row for each.
enum class Fault {
    none,
    starting,
    // Of the board.
    board_gone,
    board_silent,
    board_refuses,
    board_stamps,
    // Of the clock.
    clock_unknown,
    clock_holdover,
    clock_step,
    seconds_differ,
    host_undisciplined,
    // Of a camera: it cannot be had.
    camera_absent,
    camera_unreachable,
    camera_busy,
    camera_lease,
    camera_misconfigured,
    camera_silent,
    camera_failed,
    // Of a camera: its frames.
    link_full,
    packet_size,
    packet_loss,
    wrong_size,
    no_buffer,
    no_triggers,
    late_records,
    exposure_too_long,
    strobe_inverted,
    no_exposure,
    no_frames,
    camera_clock,
    rate_too_high,
    triggers_ignored,
    double_frames,
    block_ids,
    strobe_missing,
    line_delays,
    wrong_exposure,
    unproved,
    too_slow,
    // Of a camera that is triggered by PTP time.
    ptp_master,
    ptp_lost,
    ptp_other_time,
    ptp_unread,
    ptp_refused,
    ptp_stamps,
    ptp_contradicted,
    // Of an IMU.
    imu_missing,
    imu_wrong,
    imu_silent,
    imu_failed,
    imu_faulty,
    // Of a time output.
    time_unknown,
    time_silent,
    time_wrong,
    // Of a LiDAR.
    lidar_not_following,
    lidar_unproved,
};
constexpr Fault last_fault = Fault::lidar_unproved;
const char* to_string(Fault fault);  ///< its word in the status; empty: none

struct Diagnosis {
    Health health = Health::ok;
    Fault fault = Fault::none;
    std::string hint;
    HostTime since;  ///< filled in by who remembers
};

/// Those of effects need those of their causes: board first, then clock, then the others.
Diagnosis diagnose_board(const Status& status);
Diagnosis diagnose_clock(const Status& status);
Diagnosis diagnose(const CameraStatus& camera, const Status& status);
Diagnosis diagnose(const ImuStatus& imu, const Status& status);
Diagnosis diagnose(const TimeOutputStatus& output, const Status& status);
Diagnosis diagnose(const LidarStatus& lidar, const Status& status);

/// Of a part that failed, one sentence.
std::string describe_failure(const ImuReport& imu);

}  // namespace versavis::daemon
