// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/camera_calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <vector>

#include "export/export.hpp"
#include "recording/kalibr_yaml.hpp"

namespace versavis::client {

namespace {

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

}  // namespace

Expected<Camchain> read_camchain(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::string text{std::istreambuf_iterator<char>(file), {}};
    if (!file) return failure(path, "cannot be read", "check its name and permissions");
    return Camchain{std::move(text), path};
}

Expected<CameraCalibration> calibration_of(const Camchain& camchain, const std::string& camera,
                                           std::uint32_t width, std::uint32_t height) {
    const auto cameras = parse_camchain(camchain.text, camchain.where);
    if (!cameras) return Unexpected(cameras.error());
    const CalibratedCamera* found = camera_of(*cameras, camera);
    if (found == nullptr)
        return failure(camchain.where, "has no camera " + camera,
                       "its rostopic must be " + image_topic(camera));
    if (found->width != 0 && (found->width != width || found->height != height))
        return failure(camchain.where + ", " + found->key,
                       fmt::format("is for {} x {} pixels, the frames have {} x {}", found->width,
                                   found->height, width, height),
                       "calibrate at the size that is recorded");
    auto model = model_of(*found, camchain.where);
    if (!model) return Unexpected(model.error());
    return CameraCalibration{*model, found->time_shift_s};
}

CameraModel pinhole(double focal, std::uint32_t width, std::uint32_t height) {
    return {focal, focal, (width - 1) / 2.0, (height - 1) / 2.0, Distortion::none, {}};
}

}  // namespace versavis::client
