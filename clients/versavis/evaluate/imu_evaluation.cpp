// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/imu_evaluation.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>

#include "evaluate/grey_image.hpp"
#include "evaluate/recorded_imu.hpp"
#include "export/export.hpp"
#include "recording/kalibr_yaml.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

constexpr double degrees = 180 / M_PI;

/// Text of the camchain, and what errors call it; none: there is no calibration.
Expected<std::optional<std::pair<std::string, std::string>>> camchain_text_of(
    const Recording& recording, const std::string& path) {
    using Found = std::optional<std::pair<std::string, std::string>>;
    if (path.empty()) {
        const Attachment* attached = recording.attachment("calibration/camchain.yaml");
        if (attached == nullptr) return Found();
        return Found({attached->content, attached->name});
    }
    std::ifstream file(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    if (!file) return failure(path, "cannot be read", "check its name and permissions");
    return Found({text, path});
}

Expected<CameraModel> model_of(const CalibratedCamera& camera, const std::string& where) {
    const auto wrong = [&](const std::string& what) {
        return failure(where + ", " + camera.key, what,
                       "calibrate as pinhole with radtan or equidistant, or give --focal");
    };
    if (camera.model != "pinhole") return wrong("the model " + camera.model + " is not supported");
    if (camera.intrinsics.size() != 4) return wrong("a pinhole has four intrinsics");
    CameraModel model{camera.intrinsics[0], camera.intrinsics[1], camera.intrinsics[2],
                      camera.intrinsics[3], Distortion::none,     {}};
    if (camera.distortion == "radtan") model.distortion = Distortion::radtan;
    if (camera.distortion == "equidistant") model.distortion = Distortion::equidistant;
    if (model.distortion == Distortion::none) {
        if (camera.distortion.empty() || camera.distortion == "none") return model;
        return wrong("the distortion " + camera.distortion + " is not supported");
    }
    if (camera.coefficients.size() != 4) return wrong("four coefficients of distortion are needed");
    std::copy(camera.coefficients.begin(), camera.coefficients.end(), model.coefficients.begin());
    return model;
}

/// Those of a camchain are named by topic, or by key.
const CalibratedCamera* camera_of(const std::vector<CalibratedCamera>& cameras,
                                  const std::string& name) {
    for (const CalibratedCamera& camera : cameras)
        if (camera.topic.rfind("/" + name + "/", 0) == 0) return &camera;
    for (const CalibratedCamera& camera : cameras)
        if (camera.key == name) return &camera;
    return nullptr;
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

json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

Expected<CameraModel> camera_model(const Recording& recording,
                                   const ImuEvaluationSettings& settings,
                                   const FrameMetadata& frame, ImuEvaluation& evaluation) {
    if (settings.focal > 0) {
        evaluation.notes.emplace_back("the lens is assumed to be free of distortion (--focal)");
        return CameraModel{settings.focal,           settings.focal,   (frame.width - 1) / 2.0,
                           (frame.height - 1) / 2.0, Distortion::none, {}};
    }
    const auto text = camchain_text_of(recording, settings.calibration);
    if (!text) return Unexpected(text.error());
    if (!*text)
        return failure(evaluation.camera, "the recording has no calibration of its lens",
                       "give --calibration camchain.yaml, or --focal with its focal length in "
                       "pixels");
    const auto& [content, where] = **text;
    const auto cameras = parse_camchain(content, where);
    if (!cameras) return Unexpected(cameras.error());
    const CalibratedCamera* camera = camera_of(*cameras, evaluation.camera);
    if (camera == nullptr)
        return failure(where, "has no camera " + evaluation.camera,
                       "its rostopic must be " + image_topic(evaluation.camera));
    if (camera->width != 0 && (camera->width != frame.width || camera->height != frame.height))
        return failure(where + ", " + camera->key,
                       fmt::format("is for {} x {} pixels, the frames have {} x {}", camera->width,
                                   camera->height, frame.width, frame.height),
                       "calibrate at the size that is recorded");
    evaluation.calibrated_shift_s = camera->time_shift_s;
    return model_of(*camera, where);
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
    return evaluation;
}

json to_json(const ImuEvaluation& evaluation) {
    const RotationOffset& found = evaluation.found;
    const Eigen::Quaterniond& q = found.camera_from_imu;
    return {{"camera", evaluation.camera},
            {"imu", evaluation.imu},
            {"timeshift_cam_imu_s", found.offset_s},
            {"timeshift_cam_imu_sigma_s", found.offset_sigma_s},
            {"rotation_cam_imu_wxyz", {q.w(), q.x(), q.y(), q.z()}},
            {"rotation_sigma_rad", vector_json(found.rotation_sigma)},
            {"gyro_bias_rad_s", vector_json(found.gyro_bias)},
            {"gyro_bias_sigma_rad_s", vector_json(found.gyro_bias_sigma)},
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
    const Eigen::Matrix3d rotation = found.camera_from_imu.toRotationMatrix();
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
    text += fmt::format("rotation from {} to {}, +- {:.2f} degrees\n", evaluation.imu,
                        evaluation.camera, found.rotation_sigma.maxCoeff() * degrees);
    for (int row = 0; row < 3; ++row)
        text += fmt::format("  {:9.5f} {:9.5f} {:9.5f}\n", rotation(row, 0), rotation(row, 1),
                            rotation(row, 2));
    text +=
        fmt::format("bias of the gyro {:.5f} {:.5f} {:.5f} rad/s +- {:.5f}\n", found.gyro_bias.x(),
                    found.gyro_bias.y(), found.gyro_bias.z(), found.gyro_bias_sigma.maxCoeff());
    for (const std::string& note : evaluation.notes) text += "note: " + note + "\n";
    return text;
}

}  // namespace versavis::client
