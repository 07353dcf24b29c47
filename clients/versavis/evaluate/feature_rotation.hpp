// SPDX-License-Identifier: BSD-3-Clause
// How a camera turned between consecutive frames, from features that are tracked in them.
#pragma once

#include <memory>
#include <optional>

#include "evaluate/camera_model.hpp"
#include "evaluate/grey_image.hpp"
#include "evaluate/rotation_offset.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// Estimates the camera's rotation from frame to frame by tracking corners. Used by one thread,
/// which adds the frames in order.
class FeatureRotation {
 public:
    /// `features`: looked for in each frame; with fewer, the rotation is less certain, and it takes
    /// less time. Error: built without OpenCV.
    static Expected<FeatureRotation> create(const CameraModel& camera, int features = 300);

    /// Of the whole process: OpenCV's own threads make small pictures dearer, and not faster.
    static void use_one_thread();

    FeatureRotation(FeatureRotation&&) noexcept;
    FeatureRotation& operator=(FeatureRotation&&) noexcept;
    ~FeatureRotation();

    /// The rotation since the frame before. None: of the first frame, or where too few features
    /// agree. Error: the frame's size changed.
    Expected<std::optional<FrameRotation>> add(GreyImage image, OutputTime time);

 private:
    struct Tracker;
    explicit FeatureRotation(std::unique_ptr<Tracker> tracker);

    std::unique_ptr<Tracker> tracker_;
};

}  // namespace versavis::client
