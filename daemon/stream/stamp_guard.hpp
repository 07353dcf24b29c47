// SPDX-License-Identifier: BSD-3-Clause
// Keeps the published stamps of one stream from going backwards within an epoch.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/clock/translator.hpp"
#include "versavis/metadata.hpp"

namespace versavis::daemon {

class StampGuard {
 public:
    /// The stamp to publish: `stamp.output`, or just after the one before; then `flags` says so.
    OutputTime guard(const clock::Stamp& stamp, std::uint32_t& flags) {
        using clock::ClockState;
        if (stamp.state == ClockState::holdover || stamp.state == ClockState::step)
            flags |= flag_holdover;
        OutputTime time = stamp.output;
        if (last_ && epoch_ == stamp.epoch && time <= *last_) {
            time = *last_ + nanoseconds(1);
            flags |= flag_clamped;
        }
        last_ = time;
        epoch_ = stamp.epoch;
        return time;
    }

 private:
    std::optional<OutputTime> last_;
    std::uint32_t epoch_ = 0;
};

}  // namespace versavis::daemon
