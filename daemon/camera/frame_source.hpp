// SPDX-License-Identifier: BSD-3-Clause
// Frames of one camera, however they are received: held against what was announced, and handed to
// its pipeline.
#pragma once

#include <atomic>
#include <limits>
#include <string>

#include "camera/auto_exposure.hpp"
#include "camera/camera_setup.hpp"
#include "pipeline/camera_pipeline.hpp"

namespace versavis::daemon {

/// A frame is kept open until its trailer may have come, even where the leader leaves when the
/// exposure begins. No longer: complete frames wait behind one that lost packets.
Duration frame_retention(const CameraConfiguration& configuration);

class FrameSource {
 public:
    virtual ~FrameSource() = default;
    FrameSource(const FrameSource&) = delete;
    FrameSource& operator=(const FrameSource&) = delete;

    /// True: frames must be fetched by poll(), because this transport calls nobody.
    virtual bool needs_polling() const { return false; }
    virtual void poll(Duration /*timeout*/) {}

    /// Packets that arrived so far.
    virtual std::uint64_t packets() const = 0;

    /// Frames come that this source cannot receive.
    virtual bool unsuited() const { return false; }

    /// What frames are like that do not fit any more, because size or format of all has changed;
    /// empty: they fit.
    std::string changed() const;

    /// Its stamps are the same for frame after frame.
    bool clock_frozen() const { return equal_stamps_ >= stamps_of_a_standing_clock; }

    /// Frames of any kind that were taken so far.
    std::uint64_t taken() const { return taken_; }

 protected:
    /// What arrived of a frame.
    struct Received {
        std::uint32_t slot = 0;
        std::uint64_t block_id = 0;  ///< without wraps; 0: unknown
        HostTime arrived;
        bool complete = false;
        std::uint64_t size = 0;  ///< bytes, with all that follows the image
        const std::byte* pixels = nullptr;
        std::uint32_t width = 0;
        std::uint32_t height = 0;
        std::uint32_t pixel_format = 0;
        std::uint32_t padding_x = 0;  ///< bytes at the end of each row
        CameraTime camera_time;
        Duration exposure;                                     ///< by its chunks; 0: it has none
        float gain = std::numeric_limits<float>::quiet_NaN();  ///< the same
    };

    /// What is passed must outlive the source; `meter` may be null.
    FrameSource(const CameraConfiguration& configuration, const CameraSetup& setup,
                CameraPipeline& pipeline, FrameMeter* meter)
        : configuration_(configuration), setup_(setup), pipeline_(pipeline), meter_(meter) {}

    /// The slot is the pipeline's from here on. True: the frame is as it was announced.
    bool hand_over(const Received& frame);

    const CameraConfiguration& configuration_;
    const CameraSetup setup_;
    CameraPipeline& pipeline_;

 private:
    static constexpr unsigned stamps_of_a_standing_clock = 4;

    EventReason refusal(const Received& frame) const;
    std::uint32_t stride(const Received& frame) const;
    void note_size(const Received& frame, EventReason refused);
    void note_clock(CameraTime stamp);

    FrameMeter* meter_;
    std::atomic<std::uint64_t> changed_{0};  ///< width, height and the bytes that do not fit
    std::atomic<unsigned> equal_stamps_{0};
    std::atomic<std::uint64_t> taken_{0};
    std::uint64_t last_mismatch_ = 0;  ///< the same of the newest frame, when it does not fit
    CameraTime stamp_;                 ///< of the newest frame
    std::uint32_t width_ = 0;          ///< of the first frame: the others must be of the same size
    std::uint32_t height_ = 0;
};

}  // namespace versavis::daemon
