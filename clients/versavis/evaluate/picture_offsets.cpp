// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/picture_offsets.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace versavis::client {

namespace {

// One offset of a recording is found from so much: 400 rotations at 20 Hz.
constexpr Duration recorded_stretch = seconds(20);

// Offsets within +- this are tried. What is further off is found by other witnesses.
constexpr Duration offset_range = milliseconds(100);

Duration duration_of(double s) { return {std::llround(s * 1e9)}; }

// Samples that a stretch needs before and after it.
constexpr Duration margin = offset_range * 2;

// What has not arrived so long after a stretch does not come.
constexpr Duration longest_delay = seconds(2);

}  // namespace

void PictureComparison::add(const GyroSample& sample) {
    gyro_.push_back(sample);
    const OutputTime needed =
        rotations_.empty() ? sample.time - longest_delay : rotations_.front().from - margin;
    while (gyro_.front().time < needed) gyro_.pop_front();
}

void PictureComparison::add(const FrameRotation& rotation) {
    const bool within = rotations_.empty() || rotation.to <= rotations_.front().from + stretch_;
    (within && next_.empty() ? rotations_ : next_).push_back(rotation);
}

std::optional<StretchComparison> PictureComparison::take() {
    if (rotations_.empty()) return std::nullopt;
    const OutputTime to = rotations_.front().from + stretch_;
    const auto gyro_since = [&](OutputTime time) {
        return !gyro_.empty() && gyro_.back().time >= time;
    };
    const bool complete = !next_.empty() && gyro_since(to + margin);
    const bool late =
        gyro_since(to + longest_delay) || (!next_.empty() && next_.back().to >= to + longest_delay);
    if (!complete && !late) return std::nullopt;
    return compare();
}

std::optional<StretchComparison> PictureComparison::finish() {
    // The last frame of a stretch is hardly at its very end.
    constexpr Duration rest = seconds(1);
    const bool whole =
        !rotations_.empty() && rotations_.back().to >= rotations_.front().from + stretch_ - rest;
    return whole ? std::optional(compare()) : std::nullopt;
}

StretchComparison PictureComparison::compare() {
    const OutputTime from = rotations_.front().from;
    const OutputTime to = from + stretch_;
    const auto end = std::find_if(gyro_.begin(), gyro_.end(), [&](const GyroSample& sample) {
        return sample.time >= to + margin;
    });
    const auto found = rotation_offset(rotations_, {gyro_.begin(), end}, {offset_range});
    rotations_.clear();
    for (const FrameRotation& rotation : std::exchange(next_, {})) add(rotation);
    if (!found) return {from, to, Unexpected(found.error())};
    return {
        from, to,
        PictureOffset{from, to, duration_of(found->offset_s), duration_of(found->offset_sigma_s)}};
}

void PictureComparison::restart() { *this = PictureComparison(stretch_); }

std::vector<PictureOffset> picture_offsets(const SeenMotion& motion) {
    std::vector<PictureOffset> offsets;
    const auto keep = [&](const std::optional<StretchComparison>& stretch) {
        if (stretch && stretch->offset) offsets.push_back(*stretch->offset);
    };
    PictureComparison comparison(recorded_stretch);
    auto sample = motion.gyro.begin();
    const auto add_samples = [&](OutputTime to) {
        for (; sample != motion.gyro.end() && sample->time <= to; ++sample) comparison.add(*sample);
    };
    for (const FrameRotation& rotation : motion.rotations) {
        add_samples(rotation.to + margin);
        comparison.add(rotation);
        keep(comparison.take());
    }
    if (!motion.rotations.empty()) add_samples(motion.rotations.back().to + margin);
    keep(comparison.finish());
    return offsets;
}

PictureEvidence compare_pictures(const Recording& recording,
                                 const ImuEvaluationSettings& settings) {
    ImuEvaluation evaluation;
    PictureEvidence evidence;
    const auto motion = seen_motion(recording, settings, evaluation);
    if (!motion) {
        evidence.problem = motion.error().message();
        return evidence;
    }
    evidence.offsets = picture_offsets(*motion);
    if (evidence.offsets.empty())
        evidence.problem = "no 20 s of them show how it turned: rotate irregularly";
    if (evaluation.calibrated_shift_s)
        evidence.calibrated = duration_of(*evaluation.calibrated_shift_s);
    return evidence;
}

}  // namespace versavis::client
