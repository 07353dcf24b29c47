// SPDX-License-Identifier: BSD-3-Clause
// The instants in PTP time at which a camera's exposures have their middle: the same for all hosts.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "versavis/time.hpp"

namespace versavis::daemon {

/// Point k lies k / rate after PTP's zero, which is a whole second, and the phase later. Points of
/// two rates that coincide are equal to the nanosecond: each is rounded from an exact fraction.
class PtpGrid {
 public:
    PtpGrid(double rate_hz, Duration phase)
        : rate_uhz_(std::llround(rate_hz * 1e6)), phase_(phase) {}

    CameraTime point(std::uint64_t k) const { return CameraTime{unphased_ns(k)} + phase_; }

    /// The first point that is not before `from`, nor before PTP's zero.
    std::uint64_t first(CameraTime from) const {
        const auto elapsed = static_cast<Wide>(std::max<std::int64_t>(0, (from - phase_).ns));
        auto k = static_cast<std::uint64_t>(elapsed * rate_uhz_ / ns_per_megasecond);
        while (point(k) < from) ++k;
        return k;
    }

    /// Of a point: equal for those that coincide without their phases. Microseconds of PTP time.
    std::uint64_t tick(std::uint64_t k) const {
        return static_cast<std::uint64_t>((unphased_ns(k) + 500) / 1000);
    }

 private:
    __extension__ using Wide = __int128;
    static constexpr Wide ns_per_megasecond = 1'000'000'000'000'000;

    std::int64_t unphased_ns(std::uint64_t k) const {
        return static_cast<std::int64_t>((Wide{k} * ns_per_megasecond + rate_uhz_ / 2) / rate_uhz_);
    }

    std::int64_t rate_uhz_;
    Duration phase_;
};

}  // namespace versavis::daemon
