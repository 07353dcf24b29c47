// SPDX-License-Identifier: BSD-3-Clause
// How frames and events of an emulated camera reach the host.
#pragma once

#include <cstdint>

#include "frame_queue.hpp"
#include "versavis/time.hpp"

namespace versavis::rig {

/// Numbers of events, as the camera's description has them.
enum class CameraEventId : std::uint16_t {
    exposure_start = 0x9001,
    exposure_end = 0x9002,
    trigger_missed = 0x9003,
    ptp_lost = 0x9004,
    ptp_locked = 0x9005,
};

constexpr std::uint32_t event_index(CameraEventId id) {
    return static_cast<std::uint32_t>(id) -
           static_cast<std::uint32_t>(CameraEventId::exposure_start);
}

struct TimedEvent {
    CameraEventId id;
    std::uint64_t block_id;
    std::uint64_t ticks;
    bool extended_id;
};

class CameraTransport {
 public:
    virtual ~CameraTransport() = default;

    /// Sends a frame whose leader is due, and returns when all of it has left. On a thread of the
    /// camera.
    virtual void transmit(StreamFrame frame) = 0;

    /// The acquisition has stopped. A block id may come again.
    virtual void forget_frames() {}

    /// A transport without events sends none.
    virtual void send_event(HostTime /*due*/, const TimedEvent& /*event*/) {}
};

}  // namespace versavis::rig
