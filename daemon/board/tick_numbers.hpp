// SPDX-License-Identifier: BSD-3-Clause
// Ticks of the cameras, counted on over the configurations of the board.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "versavis/time.hpp"
#include "wire/limits.hpp"

namespace versavis::daemon {

/// The board counts ticks from 0 with each configuration. Readers tell sets by their ticks, so no
/// tick may come twice in the life of the service. Not thread-safe.
class TickNumbers {
 public:
    /// A configuration was taken shortly before `now`.
    void grid_began(HostTime now) {
        if (began_)
            first_ += static_cast<std::uint64_t>(
                std::ceil(static_cast<double>((now - *began_ + longest_handshake).ns) * 1e-9 *
                          fastest_hz * fastest_pace));
        began_ = now;
    }

    /// Number in the life of the service of a tick that the board numbers so.
    std::uint64_t number(std::uint64_t tick) const { return first_ + tick; }

 private:
    /// From the configuration taken to grid_began(). If shorter, ticks come twice when the board
    /// answers slowly; if longer, more numbers are left out.
    static constexpr Duration longest_handshake = seconds(10);

    static constexpr double fastest_hz = wire::limits::fastest_camera_uhz * 1e-6;

    /// No grid follows another clock further than that.
    static constexpr double fastest_pace = 1.01;

    std::uint64_t first_ = 0;
    std::optional<HostTime> began_;
};

}  // namespace versavis::daemon
