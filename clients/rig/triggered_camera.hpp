// SPDX-License-Identifier: BSD-3-Clause
// A camera as seen from the board's wires, whatever bus its frames take.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "scenario.hpp"
#include "versavis/time.hpp"

namespace versavis::rig {

/// Where a trigger pulse came from.
struct TriggerPulse {
    std::uint64_t board_life = 0;
    std::uint64_t trigger = 0;
    HostTime at;
};

/// What its clock shows when it stamps the frame of this exposure.
inline HostTime stamped(const CameraScenario& camera, HostTime start, HostTime end) {
    switch (camera.stamps) {
        case Stamped::middle: return middle(start, end);
        case Stamped::end: return end;
        case Stamped::readout: return end + Duration{std::llround(camera.readout_us * 1e3)};
        default: return start;
    }
}

/// When the exposure line is active.
struct LineActive {
    HostTime begin;
    HostTime end;
    bool inverted = false;  ///< by the camera: low meanwhile
    unsigned times = 1;     ///< that it is so, for exposures that follow each other ...
    Duration every{};       ///< ... after so long
};

class TriggeredCamera {
 public:
    virtual ~TriggeredCamera() = default;
    /// The trigger line changed; `level` as on the wire. Returns when the exposure line is active,
    /// if it exposes, and shows it.
    virtual std::optional<LineActive> trigger_line(bool level, const TriggerPulse& pulse) = 0;
    virtual const CameraScenario& settings() const = 0;
};

}  // namespace versavis::rig
