// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/picture_offsets.hpp"

#include <cmath>

namespace versavis::client {

namespace {

// One offset is found from so much: a few of them in a minute, and 400 rotations at 20 Hz.
constexpr Duration stretch = seconds(20);

// Offsets within +- this are tried. What is further off is found by other witnesses.
constexpr Duration offset_range = milliseconds(100);

Duration duration_of(double s) { return {std::llround(s * 1e9)}; }

}  // namespace

std::vector<PictureOffset> picture_offsets(const SeenMotion& motion) {
    std::vector<PictureOffset> offsets;
    if (motion.rotations.empty() || motion.gyro.empty()) return offsets;
    const OutputTime end = motion.rotations.back().to;
    auto frame = motion.rotations.begin();
    auto sample = motion.gyro.begin();
    for (OutputTime from = motion.rotations.front().from; from + stretch <= end;
         from = from + stretch) {
        const OutputTime to = from + stretch;
        std::vector<FrameRotation> rotations;
        for (; frame != motion.rotations.end() && frame->to <= to; ++frame)
            if (frame->from >= from) rotations.push_back(*frame);
        std::vector<GyroSample> gyro;
        while (sample != motion.gyro.end() && sample->time < from - offset_range * 2) ++sample;
        for (auto one = sample; one != motion.gyro.end() && one->time < to + offset_range * 2;
             ++one)
            gyro.push_back(*one);
        const auto found = rotation_offset(rotations, gyro, {offset_range});
        if (found)
            offsets.push_back(
                {from, to, duration_of(found->offset_s), duration_of(found->offset_sigma_s)});
    }
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
        evidence.problem = "no 20 s of them show how it turned: rotate irregularly, about two axes";
    if (evaluation.calibrated_shift_s)
        evidence.calibrated = duration_of(*evaluation.calibrated_shift_s);
    return evidence;
}

}  // namespace versavis::client
