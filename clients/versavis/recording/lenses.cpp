// SPDX-License-Identifier: BSD-3-Clause
#include "recording/lenses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

#include "recording/kalibr_yaml.hpp"
#include "ros_client/names.hpp"

namespace versavis::client {

namespace {

/// None: CameraInfo has no name for it.
std::optional<RosLens> lens_of(const CalibratedCamera& camera) {
    const std::vector<double>& of = camera.intrinsics;
    RosLens lens{camera.width, camera.height, of[0], of[1], of[2], of[3], {}, camera.coefficients};
    if (camera.model != "pinhole") return std::nullopt;
    if (camera.distortion == "none") lens.coefficients.resize(4);
    if (lens.coefficients.size() != 4) return std::nullopt;
    if (camera.distortion == "equidistant") {
        lens.distortion = "equidistant";
    } else if (camera.distortion == "radtan" || camera.distortion == "none") {
        lens.distortion = "plumb_bob";
        lens.coefficients.push_back(0);  // k3
    } else {
        return std::nullopt;
    }
    return lens;
}

/// `car` of /car/cam0/image_raw.
std::string first_part(const std::string& topic) { return topic.substr(1, topic.find('/', 1) - 1); }

/// `cam0` of /car/cam0/image_raw; empty: it has no such part.
std::string part_before_image(const std::string& topic) {
    const std::size_t end = topic.find("/image_raw");
    if (end == std::string::npos || end == 0) return "";
    const std::size_t begin = topic.rfind('/', end - 1);
    return topic.substr(begin + 1, end - begin - 1);
}

}  // namespace

void Lenses::add(Lenses others) {
    others.by_topic.merge(by_topic);
    by_topic = std::move(others.by_topic);
    left_out.insert(left_out.end(), others.left_out.begin(), others.left_out.end());
}

const RosLens* Lenses::find(const std::string& stream) const {
    const std::string name = ros_client::topic_part(stream);
    for (const auto part : {first_part, part_before_image}) {
        const auto fits = [&](const auto& one) { return part(one.first) == name; };
        const auto found = std::find_if(by_topic.begin(), by_topic.end(), fits);
        if (found == by_topic.end()) continue;
        const bool alone = std::none_of(std::next(found), by_topic.end(), fits);
        return alone ? &found->second : nullptr;
    }
    return nullptr;
}

std::string Lenses::misfit(const std::string& stream, std::uint32_t width,
                           std::uint32_t height) const {
    if (by_topic.empty()) return "";
    const RosLens* lens = find(stream);
    if (lens == nullptr)
        return fmt::format("{}: no camera of the calibration has its topic, or more than one",
                           stream);
    if (lens->width == width && lens->height == height) return "";
    return fmt::format("{}: it was calibrated at {} x {}, and its frames have {} x {}", stream,
                       lens->width, lens->height, width, height);
}

Expected<Lenses> parse_lenses(const std::string& camchain, const std::string& where) {
    const auto cameras = parse_camchain(camchain, where);
    if (!cameras) return Unexpected(cameras.error());
    Lenses lenses;
    for (const CalibratedCamera& camera : *cameras) {
        const auto lens = lens_of(camera);
        if (!lens)
            lenses.left_out.push_back(fmt::format("{}: {}: CameraInfo has no name for {} with {}",
                                                  where, camera.key, camera.model,
                                                  camera.distortion));
        else if (camera.topic.find('/') != 0 || camera.topic.find('/', 1) == std::string::npos)
            lenses.left_out.push_back(
                fmt::format("{}: {}: its rostopic '{}' names no camera, as /cam0/image_raw does",
                            where, camera.key, camera.topic));
        else
            lenses.by_topic[camera.topic] = *lens;
    }
    return lenses;
}

Expected<std::string> read_kalibr_file(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file || std::filesystem::is_directory(path))
        return failure(path, "cannot be read", "give calibration files that Kalibr wrote");
    return std::string{std::istreambuf_iterator<char>(file), {}};
}

Expected<Lenses> read_lenses(const std::vector<std::string>& paths) {
    Lenses all;
    for (const std::string& path : paths) {
        const auto text = read_kalibr_file(path);
        if (!text) return Unexpected(text.error());
        auto lenses = parse_lenses(*text, path);
        if (!lenses) return Unexpected(lenses.error());
        all.add(std::move(*lenses));
    }
    return all;
}

}  // namespace versavis::client
