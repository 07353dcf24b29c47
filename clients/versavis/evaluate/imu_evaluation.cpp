// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/imu_evaluation.hpp"

#include <fmt/format.h>

#include <cmath>

#include "evaluate/camera_calibration.hpp"
#include "evaluate/grey_image.hpp"
#include "evaluate/recorded_imu.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

constexpr double degrees = 180 / M_PI;

/// None: there is no calibration.
Expected<std::optional<Camchain>> camchain_of(const Recording& recording, const std::string& path) {
    if (path.empty()) {
        const Attachment* attached = recording.attachment("calibration/camchain.yaml");
        if (attached == nullptr) return std::optional<Camchain>();
        return std::optional(Camchain{attached->content, attached->name});
    }
    auto read = read_camchain(path);
    if (!read) return Unexpected(read.error());
    return std::optional(std::move(*read));
}

/// Reads the camera's frames, and follows features from each to the next.
class Following {
 public:
    Following(const Recording& recording, const ImuEvaluationSettings& settings,
              const RecordedImu& imu, ImuEvaluation& evaluation)
        : recording_(recording), settings_(settings), imu_(imu), evaluation_(evaluation) {}

    Expected<std::vector<FrameRotation>> run() {
        const auto read = recording_.for_each({evaluation_.camera}, [this](const auto& item) {
            auto taken = take(item);
            if (!taken) failed_ = taken.error();
            return taken.value_or(false);
        });
        if (!read) return Unexpected(read.error());
        if (failed_) return Unexpected(*failed_);
        return std::move(rotations_);
    }

 private:
    Expected<bool> take(const RecordedItem& item) {
        const auto frame = unpack<FrameMetadata>(item.metadata);
        if (!settings_.watch(evaluation_.frames))
            return failure(evaluation_.camera, "stopped before the end of the recording");
        if (!counts(item, frame)) return true;
        ++evaluation_.frames;
        if (frame.stamp_kind() != StampKind::measured_middle) ++evaluation_.unmeasured;
        if (!tracker_) {
            const auto model = camera_model(recording_, settings_, frame, evaluation_);
            if (!model) return Unexpected(model.error());
            auto tracker = FeatureRotation::create(*model);
            if (!tracker) return Unexpected(tracker.error());
            tracker_.emplace(std::move(*tracker));
        }
        const auto picture = grey_picture(evaluation_.camera, frame, item.payload);
        if (!picture) return Unexpected(picture.error());
        auto rotation = tracker_->add(grey_image(*picture, frame.pixel_format), item.time);
        if (!rotation) return Unexpected(rotation.error());
        if (*rotation) {
            ++evaluation_.followed;
            rotations_.push_back(**rotation);
        }
        return true;
    }

    bool counts(const RecordedItem& item, const FrameMetadata& frame) {
        const auto& times = imu_.samples.times;
        if (item.time < times.front() || item.time > times.back()) return false;
        if ((frame.flags & flag_suspect) != 0 || item.payload.empty()) return false;
        return item.life == imu_.life && frame.epoch == imu_.epoch;
    }

    const Recording& recording_;
    const ImuEvaluationSettings& settings_;
    const RecordedImu& imu_;
    ImuEvaluation& evaluation_;
    std::optional<FeatureRotation> tracker_;
    std::vector<FrameRotation> rotations_;
    std::optional<Error> failed_;
};

std::vector<GyroSample> gyro_of(const RecordedImu& imu) {
    std::vector<GyroSample> samples;
    const auto& gyro = imu.samples.gyro;
    samples.reserve(imu.samples.times.size());
    for (std::size_t i = 0; i < imu.samples.times.size(); ++i)
        samples.push_back({imu.samples.times[i], {gyro[0][i], gyro[1][i], gyro[2][i]}});
    return samples;
}

void add_notes(const RecordedImu& imu, ImuEvaluation& evaluation) {
    auto& notes = evaluation.notes;
    if (imu.elsewhere > 0)
        notes.push_back(fmt::format(
            "{} samples of other epochs were left out: stamps do not continue across them",
            imu.elsewhere));
    if (imu.faulty > 0) notes.push_back(fmt::format("{} faulty samples were left out", imu.faulty));
    if (evaluation.unmeasured > 0)
        notes.push_back(fmt::format("{} frames are not stamped by a measured middle of exposure",
                                    evaluation.unmeasured));
    if (evaluation.followed * 10 < evaluation.frames * 9)
        notes.push_back(fmt::format(
            "only {} of {} frames could be tracked: too few corners, or motion too fast",
            evaluation.followed, evaluation.frames));
}

/// A scale nearer to 1 is usual where the scene is not far.
constexpr double noted_scale = 0.01;

void add_scale_note(ImuEvaluation& evaluation) {
    const double excess = evaluation.found.camera_scale - 1;
    if (std::abs(excess) < noted_scale) return;
    evaluation.notes.push_back(fmt::format(
        "the pictures turn by {:.1f} % {} than the gyro: the focal length of the calibration is "
        "too {}, or the scene is near; the result is corrected for it",
        std::abs(excess) * 100, excess > 0 ? "more" : "less", excess > 0 ? "short" : "long"));
}

json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

std::string rotation_text(const ImuEvaluation& evaluation) {
    const RotationOffset& found = evaluation.found;
    std::string text = fmt::format("rotation from {} to {}", evaluation.imu, evaluation.camera);
    if (!found.rotation_shown)
        return text +
               " is not known: the rig turned about one axis only. For the rotation, turn "
               "it about a second axis, too\n";
    text += fmt::format(", +- {:.2f} degrees\n", found.rotation_sigma.maxCoeff() * degrees);
    const Eigen::Matrix3d rotation = found.camera_from_imu.toRotationMatrix();
    for (int row = 0; row < 3; ++row)
        text += fmt::format("  {:9.5f} {:9.5f} {:9.5f}\n", rotation(row, 0), rotation(row, 1),
                            rotation(row, 2));
    return text;
}

}  // namespace

Expected<CameraModel> camera_model(const Recording& recording,
                                   const ImuEvaluationSettings& settings,
                                   const FrameMetadata& frame, ImuEvaluation& evaluation) {
    if (settings.focal > 0) {
        evaluation.notes.emplace_back("the lens is assumed to be free of distortion (--focal)");
        return pinhole(settings.focal, frame.width, frame.height);
    }
    const auto camchain = camchain_of(recording, settings.calibration);
    if (!camchain) return Unexpected(camchain.error());
    if (!*camchain)
        return failure(evaluation.camera, "the recording has no calibration of its lens",
                       "give --calibration camchain.yaml, or --focal with its focal length in "
                       "pixels");
    auto calibration = calibration_of(**camchain, evaluation.camera, frame.width, frame.height);
    if (!calibration) return Unexpected(calibration.error());
    evaluation.calibrated_shift_s = calibration->time_shift_s;
    return calibration->model;
}

Expected<SeenMotion> seen_motion(const Recording& recording, const ImuEvaluationSettings& settings,
                                 ImuEvaluation& evaluation) {
    const auto camera = find_stream(recording, ring::StreamKind::frames, settings.camera);
    if (!camera) return Unexpected(camera.error());
    const auto imu_name = find_stream(recording, ring::StreamKind::imu, settings.imu);
    if (!imu_name) return Unexpected(imu_name.error());
    evaluation.camera = *camera;
    evaluation.imu = *imu_name;
    const auto imu = read_imu(recording, *imu_name, settings.from_s, settings.to_s,
                              Repeated::left_out, [&] { return settings.watch(0); });
    if (!imu) return Unexpected(imu.error());
    evaluation.filter_delay = imu->filter_delay;
    auto rotations = Following(recording, settings, *imu, evaluation).run();
    if (!rotations) return Unexpected(rotations.error());
    add_notes(*imu, evaluation);
    return SeenMotion{std::move(*rotations), gyro_of(*imu)};
}

Expected<ImuEvaluation> evaluate_imu(const Recording& recording,
                                     const ImuEvaluationSettings& settings) {
    ImuEvaluation evaluation;
    const auto motion = seen_motion(recording, settings, evaluation);
    if (!motion) return Unexpected(motion.error());
    auto found = rotation_offset(motion->rotations, motion->gyro, {settings.range});
    if (!found) return Unexpected(found.error());
    evaluation.found = std::move(*found);
    add_scale_note(evaluation);
    return evaluation;
}

json to_json(const ImuEvaluation& evaluation) {
    const RotationOffset& found = evaluation.found;
    const Eigen::Quaterniond& q = found.camera_from_imu;
    return {{"camera", evaluation.camera},
            {"imu", evaluation.imu},
            {"timeshift_cam_imu_s", found.offset_s},
            {"timeshift_cam_imu_sigma_s", found.offset_sigma_s},
            {"rotation_cam_imu_wxyz",
             found.rotation_shown ? json{q.w(), q.x(), q.y(), q.z()} : json(nullptr)},
            {"rotation_sigma_rad",
             found.rotation_shown ? vector_json(found.rotation_sigma) : json(nullptr)},
            {"gyro_bias_rad_s", vector_json(found.gyro_bias)},
            {"gyro_bias_sigma_rad_s", vector_json(found.gyro_bias_sigma)},
            {"camera_scale", found.camera_scale},
            {"residual_rad", found.residual},
            {"outlier_share", found.outlier_share},
            {"frames", evaluation.frames},
            {"rotations", found.rotations},
            {"filter_delay_ns", evaluation.filter_delay.ns},
            {"calibrated_timeshift_s",
             evaluation.calibrated_shift_s ? json(*evaluation.calibrated_shift_s) : json(nullptr)},
            {"notes", evaluation.notes}};
}

std::string to_text(const ImuEvaluation& evaluation) {
    const RotationOffset& found = evaluation.found;
    std::string text = fmt::format(
        "{} and {}: {} rotations between {} frames, residual {:.2f} mrad, {:.1f} % outliers\n"
        "time of {} = time of {} {:+.3f} ms +- {:.3f} ms\n",
        evaluation.camera, evaluation.imu, found.rotations, evaluation.frames, found.residual * 1e3,
        found.outlier_share * 100, evaluation.imu, evaluation.camera, found.offset_s * 1e3,
        found.offset_sigma_s * 1e3);
    if (evaluation.filter_delay.ns != 0)
        text += fmt::format("  the delay of the IMU's filter, {:.3f} ms, is already subtracted\n",
                            static_cast<double>(evaluation.filter_delay.ns) * 1e-6);
    if (evaluation.calibrated_shift_s)
        text += fmt::format("  the calibration says {:+.3f} ms\n",
                            *evaluation.calibrated_shift_s * 1e3);
    text += rotation_text(evaluation);
    text +=
        fmt::format("bias of the gyro {:.5f} {:.5f} {:.5f} rad/s +- {:.5f}\n", found.gyro_bias.x(),
                    found.gyro_bias.y(), found.gyro_bias.z(), found.gyro_bias_sigma.maxCoeff());
    for (const std::string& note : evaluation.notes) text += "note: " + note + "\n";
    return text;
}

}  // namespace versavis::client
