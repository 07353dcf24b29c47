// SPDX-License-Identifier: BSD-3-Clause
// The status document (docs/contracts/status.md) from the reports of the parts.
#pragma once

#include <string>
#include <vector>

#include "board/board_link.hpp"
#include "board/grid_alignment.hpp"
#include "board/time_announcer.hpp"
#include "camera/camera.hpp"
#include "delivery.hpp"
#include "diagnosis.hpp"
#include "engine/clock/translator.hpp"
#include "lidar_reports.hpp"
#include "pipeline/camera_pipeline.hpp"
#include "pipeline/imu_pipeline.hpp"
#include "pipeline/nmea_pipeline.hpp"

namespace versavis::daemon {

struct CameraStatus {
    std::string name;
    CameraConfiguration configuration;
    CameraReport camera;
    PipelineReport pipeline;
    PipelineReport recent{};  ///< its counters, of the last moments only
    DeliveryReport delivery{};
    Diagnosis diagnosis{};

    bool triggered() const { return configuration.trigger == TriggerSource::board; }
};

struct ImuStatus {
    ImuReport report;
    ImuReport recent{};  ///< its counters, of the last moments only
    DeliveryReport delivery{};
    Diagnosis diagnosis{};
};

struct TimeOutputStatus {
    TimeOutputReport report;
    Diagnosis diagnosis{};
};

struct LidarStatus {
    LidarReport report;
    Diagnosis diagnosis{};
};

struct StreamStatus {
    std::string name;
    std::string kind;
    std::uint64_t items = 0;
    double rate_hz = 0;  ///< over the last interval
};

struct Status {
    std::string instance;
    std::string release;        ///< of the service
    std::string configuration;  ///< its file
    HostTime started;
    HostTime changed;  ///< somebody asked for a change, which makes devices start anew
    HostTime now;
    bool board_needed = true;
    BoardReport board;
    Diagnosis board_diagnosis;
    clock::ClockReport clock;
    clock::PpsLabels pps_labels = clock::PpsLabels::off;  ///< as configured
    Diagnosis clock_diagnosis;
    GridReport grid;
    std::vector<CameraStatus> cameras;
    std::vector<ImuStatus> imus;
    std::vector<TimeOutputStatus> time_outputs;
    std::vector<LidarStatus> lidars;
    std::optional<NmeaReport> nmea;
    std::optional<PtpReport> ptp;
    std::vector<StreamStatus> streams;
};

/// The board's firmware is of an older release than the service.
bool firmware_outdated(const Status& status);

/// That of the device that is worst off.
Health health(const Status& status);

/// How a device is, in short.
struct DeviceSummary {
    std::string name;
    std::string state;
    Health health = Health::starting;
    std::string hint;  ///< empty: all is well
};

/// The health in one line, and that of each camera.
struct Summary {
    Health health = Health::starting;
    bool dead = false;  ///< a device that is degraded delivers nothing at all
    std::string cause;  ///< the first device in the order of cause, and its fault
    std::string text = to_string(health);  ///< the same with its hint, and who else is as badly off
    std::vector<DeviceSummary> cameras{};
    Fault fault = Fault::none;  ///< of the cause
};
Summary summary(const Status& status);

std::string to_json(const Status& status);

}  // namespace versavis::daemon
