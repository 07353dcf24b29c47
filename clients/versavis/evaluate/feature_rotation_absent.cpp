// SPDX-License-Identifier: BSD-3-Clause
// In place of feature_rotation.cpp where there is no OpenCV.
#include "evaluate/feature_rotation.hpp"

namespace versavis::client {

struct FeatureRotation::Tracker {};

void FeatureRotation::use_one_thread() {}

FeatureRotation::FeatureRotation(std::unique_ptr<Tracker> tracker) : tracker_(std::move(tracker)) {}
FeatureRotation::FeatureRotation(FeatureRotation&&) noexcept = default;
FeatureRotation& FeatureRotation::operator=(FeatureRotation&&) noexcept = default;
FeatureRotation::~FeatureRotation() = default;

Expected<FeatureRotation> FeatureRotation::create(const CameraModel& /*camera*/, int /*features*/) {
    return failure("features", "this program was built without OpenCV",
                   "install Debian's libopencv-video-dev and build it again");
}

// NOLINTNEXTLINE(performance-unnecessary-value-param): as its twin with OpenCV has it
Expected<std::optional<FrameRotation>> FeatureRotation::add(GreyImage /*image*/,
                                                            OutputTime /*time*/) {
    return std::nullopt;
}

}  // namespace versavis::client
