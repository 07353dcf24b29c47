// SPDX-License-Identifier: BSD-3-Clause
// Where the grid of the board's triggers lies, by its own account.
#pragma once

#include <cstdint>
#include <optional>

#include "versavis/time.hpp"
#include "wire/configuration.hpp"

namespace versavis::daemon {

/// From a grid's origin to a tick, as the board counts them, without drift.
inline Duration until_tick(std::uint64_t tick, std::uint32_t rate_uhz) {
    __extension__ using Wide = __int128;
    constexpr Wide femtohertz = 1'000'000'000'000'000;
    return {static_cast<std::int64_t>(static_cast<Wide>(tick) * femtohertz / rate_uhz)};
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
        if (!answer_ || camera >= wire::camera_count || tick > furthest_tick) return std::nullopt;
        const wire::CameraConfiguration& taken = answer_->taken.cameras[camera];
        if (taken.rate_uhz == 0) return std::nullopt;
        const Duration after = until_tick(tick, taken.rate_uhz) +
                               Duration{std::int64_t{taken.phase_ns} - taken.latency_ns};
        return BoardTime{answer_->origin_ns} + after;
    }

 private:
    /// 31 years at 1 kHz; later ones are no ticks.
    static constexpr std::uint64_t furthest_tick = std::uint64_t{1} << 40U;

    std::optional<wire::ConfigurationAnswer> answer_;
};

}  // namespace versavis::daemon
