// SPDX-License-Identifier: BSD-3-Clause
// Where the grid of the board's triggers lies, by its own account.
#pragma once

#include <cstdint>
#include <optional>

#include "versavis/time.hpp"
#include "wire/configuration.hpp"

namespace versavis::daemon {

/// From a grid's origin to a tick, as the board counts them, without drift.
__extension__ using WideNanoseconds = __int128;
inline WideNanoseconds until_tick(std::uint64_t tick, std::uint32_t rate_uhz) {
    constexpr WideNanoseconds scale = 1'000'000'000'000'000;  // of ns and micro-hertz
    return static_cast<WideNanoseconds>(tick) * scale / rate_uhz;
}

/// By the answer to the configuration, which holds while nothing moves the grid: a second witness
/// of what records say. Not thread-safe.
class TriggerGrid {
 public:
    void configured(const wire::ConfigurationAnswer& answer) { answer_ = answer; }
    void forget() { answer_.reset(); }

    /// When the trigger of this tick leaves, if no exposure is expected of it: half of what is
    /// expected is taken off that. None: nothing is known of it.
    std::optional<BoardTime> trigger(unsigned camera, std::uint64_t tick) const {
        if (!answer_ || camera >= wire::camera_count) return std::nullopt;
        const wire::CameraConfiguration& taken = answer_->taken.cameras[camera];
        if (taken.rate_uhz == 0) return std::nullopt;
        const WideNanoseconds at = until_tick(tick, taken.rate_uhz) + answer_->origin_ns +
                                   taken.phase_ns - taken.latency_ns;
        if (at <= 0 || at > latest_ns) return std::nullopt;
        return BoardTime{static_cast<std::int64_t>(at)};
    }

 private:
    /// 36 years after the board's start: what a false tick or origin leads to is no instant.
    static constexpr WideNanoseconds latest_ns = std::int64_t{1} << 60U;

    std::optional<wire::ConfigurationAnswer> answer_;
};

}  // namespace versavis::daemon
