// SPDX-License-Identifier: BSD-3-Clause
// Kinds of streams by name.
#pragma once

#include "versavis/ring_layout.hpp"

namespace versavis::client {

inline const char* kind_name(ring::StreamKind kind) {
    switch (kind) {
        case ring::StreamKind::frames: return "frames";
        case ring::StreamKind::imu: return "imu";
        case ring::StreamKind::events: return "events";
        case ring::StreamKind::status: return "status";
        case ring::StreamKind::evidence: return "evidence";
        case ring::StreamKind::clock: return "clock";
        case ring::StreamKind::nmea: return "nmea";
    }
    return "unknown";
}

}  // namespace versavis::client
