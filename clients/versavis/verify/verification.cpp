// SPDX-License-Identifier: BSD-3-Clause
#include "verify/verification.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "recording/recording.hpp"
#include "verify/camera_judge.hpp"
#include "verify/clock_witness.hpp"
#include "verify/imu_judge.hpp"
#include "verify/picture_judge.hpp"
#include "verify/stream_order.hpp"

namespace versavis::client {

namespace {

/// Of the first item of any stream: evidence may be older.
HostTime begin_of(const RecordedEvidence& evidence) {
    std::vector<HostTime> first;
    for (const CameraEvidence& camera : evidence.cameras)
        if (!camera.frames.empty()) first.push_back(camera.frames.front().frame.arrival);
    for (const ImuEvidence& imu : evidence.imus)
        if (!imu.samples.empty()) first.push_back(imu.samples.front().host);
    if (first.empty()) return {};
    return *std::min_element(first.begin(), first.end());
}

void note_pictures(const RecordedEvidence& evidence, Verification& verification) {
    for (const CameraEvidence& camera : evidence.cameras) {
        const PictureEvidence& pictures = camera.pictures;
        if (!pictures.problem.empty())
            verification.notes.push_back(
                fmt::format("{}: pictures are not compared: {}", camera.name, pictures.problem));
        const PictureJudge judge(pictures);
        if (const auto& usual = judge.usual())
            verification.notes.push_back(fmt::format(
                "{}: by {} parts of its pictures, the IMU's stamps are {:+.3f} ms +- {:.3f} ms "
                "later",
                camera.name, pictures.offsets.size(), static_cast<double>(usual->offset.ns) * 1e-6,
                static_cast<double>(usual->sigma.ns) * 1e-6));
    }
}

}  // namespace

Grade Verification::grade() const {
    if (streams.empty()) return Grade::plausible;
    Grade worst = Grade::proved;
    for (const StreamVerdict& stream : streams) worst = std::min(worst, stream.grade());
    return worst;
}

Verification verify(const RecordedEvidence& evidence) {
    const ClockWitness clock(evidence.clock, evidence.output_clock);
    const HostTime begin = begin_of(evidence);
    const auto order_of = [&](const std::string& name, const std::vector<RecordedGap>& gaps) {
        const auto differing = evidence.message_stamps.find(name);
        return StreamOrder(
            gaps, begin, differing == evidence.message_stamps.end() ? nullptr : &differing->second);
    };
    Verification verification;
    for (const CameraEvidence& camera : evidence.cameras)
        if (!camera.frames.empty() || camera.impossible > 0)
            verification.streams.push_back(
                judge_camera(camera, clock, order_of(camera.name, camera.gaps)));
    for (const ImuEvidence& imu : evidence.imus) {
        const auto found = evidence.set_up.find(imu.name);
        verification.streams.push_back(judge_imu(
            imu, found == evidence.set_up.end() ? std::vector<BoardTime>() : found->second, clock,
            order_of(imu.name, imu.gaps)));
    }
    std::vector<Duration> widths;
    for (const ClockBounds& life : clock.lives()) {
        ++verification.board_lives;
        verification.exchanges += life.exchanges();
        verification.refused_exchanges += life.refused_exchanges();
        verification.bounds_width = std::max(verification.bounds_width, life.usual_width());
    }
    for (const StreamVerdict& stream : verification.streams)
        if (!stream.seconds.empty())
            verification.seconds =
                std::max(verification.seconds, stream.seconds.rbegin()->first + 1);
    return verification;
}

Expected<Verification> verify_recording(const std::string& path, const std::function<bool()>& go_on,
                                        const std::map<std::string, PictureEvidence>& pictures) {
    const auto recording = Recording::open(path);
    if (!recording) return Unexpected(recording.error());
    auto evidence = read_evidence(*recording, go_on);
    if (!evidence) return Unexpected(evidence.error());
    for (CameraEvidence& camera : evidence->cameras)
        if (const auto found = pictures.find(camera.name); found != pictures.end())
            camera.pictures = found->second;
    Verification verification = verify(*evidence);
    note_pictures(*evidence, verification);
    verification.file = std::filesystem::path(path).filename().string();
    if (!recording->facts().defect.empty())
        verification.notes.push_back("the end of the file is missing: " +
                                     recording->facts().defect);
    for (const std::string& damage : recording->damages()) verification.notes.push_back(damage);
    for (const std::string& missing : recording->facts().missing)
        verification.notes.push_back("a file of the recording is missing: " + missing);
    if (verification.streams.empty())
        verification.notes.emplace_back("there are no frames and no samples in it");
    return verification;
}

}  // namespace versavis::client
