// SPDX-License-Identifier: BSD-3-Clause
#include "stream/exposure_check.hpp"

#include "engine/pairing/alignment.hpp"

namespace versavis::daemon {

namespace {

/// How long a new exposure takes to hold in slow cameras. At half, a camera that takes it late is
/// said to be miswired; at twice, a miswired one is found half a second later.
constexpr Duration exposure_settling = milliseconds(500);

/// Frames that may still have the old exposure: those in the camera's queue. At half, cameras with
/// deep queues are said to be miswired after each change; at twice, the check starts later.
constexpr int settling_frames = 5;

}  // namespace

ExposureCheck::ExposureCheck(const CameraConfiguration& configuration)
    : enabled_(configuration.check_exposure),
      settling_(exposure_settling + period_of(configuration) * settling_frames) {}

void ExposureCheck::set_camera_exposure(Duration exposure, HostTime since) {
    camera_exposure_ = exposure;
    since_ = since;
}

bool ExposureCheck::contradicts(const pairing::Arrival& arrival,
                                const pairing::Exposure& exposure) {
    told_ = arrival.exposure.ns != 0 ? arrival.exposure : told_at(exposure.earliest_on_host);
    if (exposure.kind != StampKind::measured_middle) return false;
    measured_ = exposure.end - exposure.start;
    contradicted_ = enabled_ && told_.ns != 0 && pairing::lengths_differ(told_, measured_);
    return contradicted_;
}

}  // namespace versavis::daemon
