// SPDX-License-Identifier: BSD-3-Clause
// What the parts of the board report to.
#pragma once

#include <cstdint>

#include "hal.hpp"
#include "wire/messages.hpp"

namespace versavis::firmware {

/// What a channel reports to.
struct ChannelReports {
    virtual void exposure(const wire::Exposure& record) = 0;
    virtual void event(wire::BoardEventKind kind, std::uint8_t source, Nanoseconds at,
                       std::int64_t value, std::uint16_t detail = 0) = 0;
    /// A trigger was decided: an exposure of `duration` is expected at `start`.
    virtual void exposure_planned(std::uint8_t camera, Nanoseconds start, Nanoseconds duration) = 0;

 protected:
    ~ChannelReports() = default;
};

}  // namespace versavis::firmware
