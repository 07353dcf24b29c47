// SPDX-License-Identifier: BSD-3-Clause
// What pairing gets of one camera: exposures by the board, frames by the camera.
#pragma once

#include <cstdint>

#include "versavis/metadata.hpp"
#include "versavis/time.hpp"

namespace versavis::pairing {

/// An instant of an exposure that the time of its frame is held against. A camera stamps one of the
/// first three, or a readout that begins a constant time after the end, which is the same here.
enum class Instant : std::uint32_t {
    unknown = 0,
    start = 1,
    middle = 2,
    end = 3,
    arrival = 4,  ///< the end on the host, against which the arrival is held
};
const char* to_string(Instant instant);

/// One trigger of the camera, as the board recorded it.
struct Exposure {
    std::uint64_t trigger = 0;  ///< consecutive: one per pulse
    std::uint64_t tick = 0;
    BoardTime start;  ///< start of the exposure, predicted when it was not measured
    BoardTime end;
    HostTime end_on_host;
    HostTime earliest_on_host;  ///< its end, or its start when the end was not seen: no frame of it
                                ///< can arrive earlier
    StampKind kind = StampKind::measured_middle;
    bool exposed = true;   ///< false: the exposure line is wired and stayed silent
    HostTime recorded;     ///< when its record reached the host; 0: unknown
    Duration delay;        ///< of the lines, already taken off the middle; of the stamp alone
    Duration delay_sigma;  ///< one standard deviation of it
    bool length_by_camera =
        false;  ///< the end follows from the camera's events; of the stamp alone
};

/// One complete frame.
struct Arrival {
    std::uint32_t slot = 0;      ///< where its pixels lie; handed back in the outcome
    std::uint64_t block_id = 0;  ///< without wraps
    CameraTime camera_time;      ///< 0: the camera has no usable clock
    HostTime arrived;
    Duration exposure;  ///< by the camera's own account, in its chunk data; 0: unknown
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t stride = 0;  ///< bytes from row to row
    std::uint32_t pixel_format = 0;
    std::uint32_t size = 0;  ///< bytes
    SensorState sensor;      ///< handed on
};

/// Why a frame that the camera sent did not arrive. Explains the trigger that is left without one.
struct Shortfall {
    std::uint64_t block_id = 0;  ///< 0: unknown
    EventReason reason = EventReason::frame_incomplete;
};

}  // namespace versavis::pairing
