// SPDX-License-Identifier: BSD-3-Clause
// Frames of several cameras as sets, and for each frame that is in none why it is not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "export/sequence.hpp"
#include "recording/recording.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// Why something is not exported.
enum class SkipReason : std::uint8_t {
    no,
    suspect,       ///< its pairing is not proved, or the sensor reported a fault
    arrival,       ///< its stamp is only that of its arrival
    edge,          ///< its stamp is that of the trigger: the exposure is not known
    holdover,      ///< the clock had lost contact
    sigma,         ///< sigma is too large, or not known
    incomplete,    ///< another camera has no frame of the same tick
    outside_imu,   ///< there is no IMU sample soon before it, or none soon after it
    not_later,     ///< its stamp is not later than the one before
    repeated,      ///< an IMU sample with the data of the one before
    no_pixels,     ///< the file has no image for it
    another_size,  ///< its size or format is not that of the camera's first frame
    brief,         ///< its sequence is too short or without images, or another IMU has a hole
};
const char* to_string(SkipReason reason);

struct TableFrame {
    OutputTime time;
    std::uint64_t number;  ///< in its ring
    Continuity continuity;
    std::optional<std::uint64_t> tick;  ///< none: not triggered
    ItemPlace place;
    SkipReason left_out = SkipReason::no;
};

/// Frames that belong together: one of each camera, as indices.
struct FrameSet {
    OutputTime name;  ///< stamp of the first camera's frame
    std::vector<std::size_t> frames;
    std::size_t sequence = 0;
};

/// First takes the metadata of all frames, then finds the sets. Used by one thread.
class FrameSetTable {
 public:
    explicit FrameSetTable(std::size_t cameras) : frames_(cameras) {}

    void add(std::size_t camera, const TableFrame& frame) { frames_[camera].push_back(frame); }

    /// Sets that have a frame of each camera, equal in life, epoch and tick; all stamps lie within
    /// one of the sequences, in which names increase. Marks the frames that are in none.
    std::vector<FrameSet> pair(const std::vector<SequenceBounds>& sequences);

    const std::vector<TableFrame>& frames(std::size_t camera) const { return frames_[camera]; }

 private:
    bool inside(const FrameSet& set, const SequenceBounds& sequence) const;
    void mark(const FrameSet& set, SkipReason reason);

    std::vector<std::vector<TableFrame>> frames_;
};

}  // namespace versavis::client
