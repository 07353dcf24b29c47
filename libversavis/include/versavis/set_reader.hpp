// SPDX-License-Identifier: BSD-3-Clause
// Sets of frames: what all cameras saw at one tick, with the IMU samples since the set before.
// Cameras of several services on one grid meet by host time.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "versavis/export.hpp"
#include "versavis/imu_window.hpp"
#include "versavis/stream.hpp"

namespace versavis {

struct VERSAVIS_API FrameSet {
    std::uint64_t tick = 0;  ///< of the first camera that is there
    EpochTime time;          ///< likewise
    Duration spread;         ///< latest less earliest stamp; of several instances, in host time
    std::vector<std::optional<Frame>> frames;  ///< in the order in which cameras were named
    /// After the set before, up to the latest stamp of this one. The first set has no samples, and
    /// the first of an epoch those of the epoch: both say that samples may be missing. A set that
    /// lacks all cameras of the IMU's instance has none; they are in the next one.
    ImuSpan imu;

    bool complete() const;
    bool valid() const;  ///< all payloads: what was read of them before this call is good
};

struct SetOptions : StreamOptions {
    std::string imu;                        ///< its stream, as "imu0" or "rear/imu0"; empty: none
    Duration patience = milliseconds(200);  ///< from a set's first frame until it is given up
    /// Sets that lack a frame are delivered, too: at once, where a camera has ended. A camera that
    /// is not there yet is taken in when it appears.
    bool partial = false;
    bool suspect = false;  ///< frames whose pairing is not proved count, too
};

/// What became of frames that are in no set.
struct SetReport {
    std::uint64_t sets = 0;        ///< delivered
    std::uint64_t incomplete = 0;  ///< sets that lacked a frame, delivered or not
    /// Frames without a tick, suspect, of another life of the service, or of a set given up before.
    std::uint64_t left_out = 0;
    std::uint64_t lost = 0;     ///< frames overwritten before they were read
    std::uint64_t skipped = 0;  ///< sets that latest() passed over
};

/// Not thread-safe. Cameras must be triggered by the board; a set is of one grid point, so cameras
/// of different rates meet where their grids do. Cameras of several instances are named with it, as
/// "rear/cam0"; their boards share pulses or a clock. Ticks and output times of two instances do
/// not compare: there, frames within 0.5 ms of each other in host time are of one set.
class VERSAVIS_API SetReader {
 public:
    /// Errors: as for FrameStream::open and ImuStream::open; invalid: no camera named, or one
    /// twice, or the IMU of an instance without a camera among them.
    static Expected<SetReader> open(const std::vector<std::string>& cameras,
                                    const SetOptions& options = {});
    SetReader(SetReader&&) noexcept;
    SetReader& operator=(SetReader&&) noexcept;
    ~SetReader();

    /// The next set, in the order of ticks, waiting for it up to `timeout` (0: not at all). Errors:
    /// Pause::nothing, restarted (once for all streams) or gone; frames that were lost only count.
    Expected<FrameSet, NoItem> next(Duration timeout);

    /// The newest set that there is, passing over older ones; if there is none, waits up to
    /// `timeout` for the next. Its IMU samples are those since the set that was delivered before.
    Expected<FrameSet, NoItem> latest(Duration timeout);

    /// For poll and epoll: readable when next() may have a set, until it has none. Errors: no
    /// descriptor or thread available.
    Expected<int> fd();

    const SetReport& report() const;

 private:
    struct State;
    explicit SetReader(std::unique_ptr<State> state);
    Expected<FrameSet, NoItem> take(Duration timeout, bool newest);
    std::unique_ptr<State> state_;
};

}  // namespace versavis
