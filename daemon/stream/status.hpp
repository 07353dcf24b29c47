// SPDX-License-Identifier: BSD-3-Clause
// The status document (docs/contracts/status.md) from the reports of the parts.
#pragma once

#include <string>
#include <vector>

#include "board/board_link.hpp"
#include "board/grid_alignment.hpp"
#include "camera/camera.hpp"
#include "engine/clock/translator.hpp"
#include "stream/camera_pipeline.hpp"
#include "stream/imu_pipeline.hpp"

namespace versavis::daemon {

struct CameraStatus {
    std::string name;
    bool triggered = true;
    bool stalled = false;   ///< no frame for longer than its rate explains
    bool unproved = false;  ///< frames come, but for long none could be proved
    CameraReport camera;
    PipelineReport pipeline;
};

struct StreamStatus {
    std::string name;
    std::string kind;
    std::uint64_t items = 0;
    double rate_hz = 0;  ///< over the last interval
};

struct Status {
    std::string instance;
    HostTime started;
    HostTime now;
    bool board_needed = true;
    BoardReport board;
    clock::ClockReport clock;
    GridReport grid;
    std::vector<CameraStatus> cameras;
    std::vector<ImuReport> imus;
    std::vector<StreamStatus> streams;
};

/// "ok", "starting" or "degraded": whether all that is configured delivers proved data.
std::string health(const Status& status);

std::string to_json(const Status& status);

}  // namespace versavis::daemon
