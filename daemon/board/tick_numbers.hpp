// SPDX-License-Identifier: BSD-3-Clause
// Ticks of the cameras, counted on over the configurations of the board.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "versavis/time.hpp"
#include "wire/limits.hpp"
#include "wire/type.hpp"

namespace versavis::daemon {

/// The board counts ticks from 0 with each configuration, and by their rates. Readers tell sets by
/// their ticks, so no tick of a camera may come twice in the life of the service. Not thread-safe.
class TickNumbers {
 public:
    /// A configuration was taken shortly before `now`, and with it a grid began.
    void grid_began(HostTime now) {
        if (began_) firsts_.fill(begin(now));
        began_ = now;
    }

    /// The cameras of the mask have another rate on the same grid from now on.
    void rate_changed(std::uint8_t cameras, HostTime now) {
        if (!began_) return;
        newest_ += apart;
        const std::uint64_t first = begin(now);
        for (unsigned i = 0; i < firsts_.size(); ++i)
            if ((cameras >> i & 1U) != 0) firsts_[i] = first;
    }

    /// Number in the life of the service of a tick that the board numbers so.
    std::uint64_t number(unsigned camera, std::uint64_t tick) const {
        return (camera < firsts_.size() ? firsts_[camera] : 0) + tick;
    }

 private:
    /// Beyond all numbers before.
    std::uint64_t begin(HostTime now) {
        newest_ += static_cast<std::uint64_t>(
            std::ceil(static_cast<double>((now - *began_ + longest_handshake).ns) * 1e-9 *
                      fastest_hz * fastest_pace));
        return newest_;
    }

    /// From the configuration taken to grid_began(). If shorter, ticks come twice when the board
    /// answers slowly; if longer, more numbers are left out.
    static constexpr Duration longest_handshake = seconds(10);

    static constexpr double fastest_hz = wire::limits::fastest_camera_uhz * 1e-6;

    /// No grid follows another clock further than that.
    static constexpr double fastest_pace = 1.01;

    /// Numbers of cameras at different rates meet never: a set is of those that exposed together.
    static constexpr std::uint64_t apart = std::uint64_t{1} << 32U;

    std::array<std::uint64_t, wire::camera_count> firsts_{};
    std::uint64_t newest_ = 0;  ///< the highest of them
    std::optional<HostTime> began_;
};

}  // namespace versavis::daemon
