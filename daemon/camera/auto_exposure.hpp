// SPDX-License-Identifier: BSD-3-Clause
// Auto exposure on the host: how bright a frame is, and how long the next ones should be exposed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>

#include "settings/configuration.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

struct Image {
    std::span<const std::byte> pixels;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t pixel_format = 0;  ///< PFNC code
};

/// Brightness of an image on a grid of at most 64 x 48 of its pixels, 0 black to 1 saturated: the
/// mean, or the value that `percentile` percent of them do not exceed. None for formats other than
/// grey and Bayer, 8 to 16 bits, unpacked.
std::optional<double> brightness(const Image& image, double percentile);

/// A controller with one state, the exposure. Brightness is taken as proportional to it: each step
/// goes part of the way in the logarithm, by a bounded factor, and small errors are left alone.
class AutoExposure {
 public:
    /// `first`: what the camera exposes now, be it within the limits or not.
    AutoExposure(const AutoExposureConfiguration& settings, Duration first)
        : settings_(settings), exposure_(first) {}

    /// The exposure to set from now on; none: leave it.
    std::optional<Duration> update(double brightness);

    Duration exposure() const { return exposure_; }

 private:
    AutoExposureConfiguration settings_;
    Duration exposure_;
};

/// Newest brightness, from the thread that receives frames to the one that controls the camera.
class FrameMeter {
 public:
    explicit FrameMeter(double percentile) : percentile_(percentile) {}

    void take(const Image& image, HostTime arrived);

    /// The brightness of the newest frame that arrived after `since` and was not asked for yet.
    std::optional<double> newest(HostTime since);

    /// False: frames are of a format that cannot be metered.
    bool usable() const;

 private:
    double percentile_;
    mutable std::mutex mutex_;
    std::optional<double> brightness_;
    HostTime arrived_;
    bool usable_ = true;
};

}  // namespace versavis::daemon
