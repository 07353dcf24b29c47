// SPDX-License-Identifier: BSD-3-Clause
// Holds the exposure that was measured against the one that the camera tells.
#pragma once

#include "configuration/configuration.hpp"
#include "engine/pairing/evidence.hpp"

namespace versavis::daemon {

/// Not thread-safe.
class ExposureCheck {
 public:
    explicit ExposureCheck(const CameraConfiguration& configuration);

    /// The camera exposes for about so long from `since` on, for slow ones some frames later; 0:
    /// its exposure changes by itself.
    void set_camera_exposure(Duration exposure, HostTime since);

    /// True when the exposure line shows another exposure than the camera tells.
    bool contradicts(const pairing::Arrival& arrival, const pairing::Exposure& exposure);

    /// What the camera keeps to at that time; 0: it varies, is unknown, or may just have changed.
    Duration told_at(HostTime at) const {
        return at > since_ + settling_ ? camera_exposure_ : Duration{};
    }

    Duration measured() const { return measured_; }  ///< of the newest frame; 0: unknown
    Duration told() const { return told_; }          ///< by the camera; 0: unknown
    bool contradicted() const { return contradicted_; }

 private:
    bool enabled_;
    Duration settling_;
    Duration camera_exposure_;
    HostTime since_;
    Duration measured_;
    Duration told_;
    bool contradicted_ = false;
};

}  // namespace versavis::daemon
