// SPDX-License-Identifier: BSD-3-Clause
#include "kalibr_yaml.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

namespace versavis::client {

namespace {

/// Inside this file only: yaml-cpp throws, and no exception leaves it.
struct BadYaml {
    YAML::Mark mark;
    std::string what;
};

YAML::Node required(const YAML::Node& map, const std::string& key) {
    const YAML::Node node = map[key];
    if (!node) throw BadYaml{map.Mark(), "'" + key + "' is missing"};
    return node;
}

template <class T>
T as(const YAML::Node& node, const std::string& key) {
    try {
        return node.as<T>();
    } catch (const YAML::Exception&) {
        throw BadYaml{node.Mark(), "'" + key + "' is not what it should be"};
    }
}

template <class T>
T value(const YAML::Node& map, const std::string& key) {
    return as<T>(required(map, key), key);
}

std::vector<double> numbers(const YAML::Node& node, const std::string& key) {
    auto list = as<std::vector<double>>(node, key);
    for (const double number : list)
        if (!std::isfinite(number)) throw BadYaml{node.Mark(), "'" + key + "' is not finite"};
    return list;
}

std::optional<Transform> transform(const YAML::Node& camera, const std::string& key) {
    const YAML::Node node = camera[key];
    if (!node) return std::nullopt;
    Transform result{};
    const BadYaml wrong{node.Mark(), "'" + key + "' is not 4 rows of 4 numbers"};
    if (!node.IsSequence() || node.size() != 4) throw BadYaml(wrong);
    for (std::size_t row = 0; row < 4; ++row) {
        const auto numbers_of_row = numbers(node[row], key);
        if (numbers_of_row.size() != 4) throw BadYaml(wrong);
        std::copy(numbers_of_row.begin(), numbers_of_row.end(), result.begin() + 4 * row);
    }
    return result;
}

CalibratedCamera parse_camera(const std::string& key, const YAML::Node& node) {
    if (!node.IsMap()) throw BadYaml{node.Mark(), "'" + key + "' is no table"};
    CalibratedCamera camera;
    camera.key = key;
    camera.model = value<std::string>(node, "camera_model");
    camera.intrinsics = numbers(required(node, "intrinsics"), "intrinsics");
    camera.distortion = value<std::string>(node, "distortion_model");
    if (const YAML::Node list = node["distortion_coeffs"])
        camera.coefficients = numbers(list, "distortion_coeffs");
    const auto resolution = value<std::vector<std::uint32_t>>(node, "resolution");
    if (resolution.size() != 2 || camera.intrinsics.size() < 4)
        throw BadYaml{node.Mark(), "'" + key + "' needs 2 numbers of resolution, and 4 intrinsics"};
    camera.width = resolution[0];
    camera.height = resolution[1];
    if (node["rostopic"]) camera.topic = value<std::string>(node, "rostopic");
    if (node["cam_overlaps"])
        camera.overlaps = value<std::vector<std::uint32_t>>(node, "cam_overlaps");
    camera.to_previous = transform(node, "T_cn_cnm1");
    camera.from_imu = transform(node, "T_cam_imu");
    if (const YAML::Node shift = node["timeshift_cam_imu"]) {
        camera.time_shift_s = as<double>(shift, "timeshift_cam_imu");
        if (!std::isfinite(*camera.time_shift_s))
            throw BadYaml{shift.Mark(), "'timeshift_cam_imu' is not finite"};
    }
    return camera;
}

/// `read` with its exceptions as errors.
template <class T, class Read>
Expected<T> guarded(const std::string& text, const std::string& where, Read read) {
    constexpr auto cure = "give a file as Kalibr writes it";
    try {
        const YAML::Node root = YAML::Load(text);
        if (!root.IsMap()) return failure(where, "is no table of YAML", cure);
        return read(root);
    } catch (const BadYaml& bad) {
        return failure(fmt::format("{}:{}", where, bad.mark.line + 1), bad.what, cure);
    } catch (const YAML::Exception& bad) {
        return failure(fmt::format("{}:{}", where, bad.mark.line + 1), bad.msg, cure);
    } catch (const std::exception& bad) {
        return failure(where, bad.what(), cure);
    }
}

template <class T, class Text>
std::string list(const T& values, Text text) {
    std::string line = "[";
    for (const auto& one : values) line += (line.size() > 1 ? ", " : "") + text(one);
    return line + "]";
}

std::string transform_text(const std::string& key, const Transform& transform) {
    std::string text = fmt::format("  {}:\n", key);
    for (std::size_t row = 0; row < 4; ++row)
        text +=
            fmt::format("  - [{}, {}, {}, {}]\n", yaml_number(transform[4 * row]),
                        yaml_number(transform[4 * row + 1]), yaml_number(transform[4 * row + 2]),
                        yaml_number(transform[4 * row + 3]));
    return text;
}

/// First `b`, then `a`.
Transform product(const Transform& a, const Transform& b) {
    Transform result{};
    for (std::size_t row = 0; row < 4; ++row)
        for (std::size_t column = 0; column < 4; ++column)
            for (std::size_t i = 0; i < 4; ++i)
                result[4 * row + column] += a[4 * row + i] * b[4 * i + column];
    return result;
}

using Pose = std::optional<Transform>;

/// From the first camera to each: along the links, or by way of the IMU.
std::vector<Pose> from_first(const std::vector<CalibratedCamera>& chain) {
    constexpr Transform identity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    std::vector<Pose> poses;
    for (const CalibratedCamera& camera : chain) {
        if (poses.empty())
            poses.emplace_back(identity);
        else if (camera.to_previous && poses.back())
            poses.emplace_back(product(*camera.to_previous, *poses.back()));
        else if (camera.from_imu && chain.front().from_imu)
            poses.emplace_back(product(*camera.from_imu, inverse(*chain.front().from_imu)));
        else
            poses.emplace_back();
    }
    return poses;
}

/// From one camera to the other.
Pose between(const Pose& one, const Pose& other) {
    if (!one || !other) return std::nullopt;
    return product(*other, inverse(*one));
}

}  // namespace

std::string yaml_number(double value) {
    auto text = fmt::format("{}", value);
    if (text.find('.') != std::string::npos) return text;
    return text.insert(std::min(text.find('e'), text.size()), ".0");
}

Expected<std::vector<CalibratedCamera>> parse_camchain(const std::string& text,
                                                       const std::string& where) {
    return guarded<std::vector<CalibratedCamera>>(
        text, where, [&](const YAML::Node& root) -> Expected<std::vector<CalibratedCamera>> {
            std::vector<CalibratedCamera> cameras;
            for (std::size_t i = 0; root[fmt::format("cam{}", i)]; ++i) {
                const auto key = fmt::format("cam{}", i);
                cameras.push_back(parse_camera(key, root[key]));
            }
            if (cameras.empty())
                return failure(where, "has no 'cam0'", "give a file as Kalibr writes it");
            return cameras;
        });
}

Expected<ImuNoise> parse_imu_noise(const std::string& text, const std::string& where) {
    return guarded<ImuNoise>(text, where, [&](const YAML::Node& root) -> Expected<ImuNoise> {
        // A results file of Kalibr has them one level deeper.
        const YAML::Node imu = root["imu0"] ? root["imu0"] : root;
        const ImuNoise noise{value<double>(imu, "accelerometer_noise_density"),
                             value<double>(imu, "accelerometer_random_walk"),
                             value<double>(imu, "gyroscope_noise_density"),
                             value<double>(imu, "gyroscope_random_walk")};
        for (const double one : {noise.accelerometer_density, noise.accelerometer_walk,
                                 noise.gyroscope_density, noise.gyroscope_walk})
            if (!std::isfinite(one) || one <= 0)
                return failure(where, "densities and random walks must be more than 0",
                               "see the part's data sheet");
        return noise;
    });
}

std::string camchain_text(const std::vector<CalibratedCamera>& cameras) {
    std::string text;
    for (const auto& camera : cameras) {
        text += camera.key + ":\n";
        if (camera.from_imu) text += transform_text("T_cam_imu", *camera.from_imu);
        if (camera.to_previous) text += transform_text("T_cn_cnm1", *camera.to_previous);
        const auto whole = [](std::uint32_t one) { return fmt::format("{}", one); };
        text += "  cam_overlaps: " + list(camera.overlaps, whole) + "\n";
        text += "  camera_model: " + camera.model + "\n";
        text += "  distortion_coeffs: " + list(camera.coefficients, yaml_number) + "\n";
        text += "  distortion_model: " + camera.distortion + "\n";
        text += "  intrinsics: " + list(camera.intrinsics, yaml_number) + "\n";
        text += fmt::format("  resolution: [{}, {}]\n", camera.width, camera.height);
        text += "  rostopic: " + camera.topic + "\n";
        if (camera.time_shift_s)
            text += "  timeshift_cam_imu: " + yaml_number(*camera.time_shift_s) + "\n";
    }
    return text;
}

std::string imu_text(const ImuNoise& noise, const std::string& topic, double rate_hz) {
    return fmt::format(
        "accelerometer_noise_density: {}\naccelerometer_random_walk: {}\n"
        "gyroscope_noise_density: {}\ngyroscope_random_walk: {}\nrostopic: {}\nupdate_rate: {}\n",
        yaml_number(noise.accelerometer_density), yaml_number(noise.accelerometer_walk),
        yaml_number(noise.gyroscope_density), yaml_number(noise.gyroscope_walk), topic,
        yaml_number(rate_hz));
}

Transform inverse(const Transform& transform) {
    Transform result{};
    for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 3; ++column) {
            result[4 * row + column] = transform[4 * column + row];
            result[4 * row + 3] -= transform[4 * column + row] * transform[4 * column + 3];
        }
    }
    result[15] = 1;
    return result;
}

std::vector<CalibratedCamera> rearranged(const std::vector<CalibratedCamera>& chain,
                                         const std::vector<std::size_t>& order) {
    const auto poses = from_first(chain);
    std::vector<CalibratedCamera> cameras;
    for (std::size_t i = 0; i < order.size(); ++i) {
        CalibratedCamera camera = chain[order[i]];
        if (i == 0)
            camera.to_previous.reset();
        else if (order[i] != order[i - 1] + 1 || !camera.to_previous)
            camera.to_previous = between(poses[order[i - 1]], poses[order[i]]);
        camera.overlaps.clear();
        for (const std::uint32_t other : chain[order[i]].overlaps)
            if (const auto found = std::find(order.begin(), order.end(), other);
                found != order.end())
                camera.overlaps.push_back(static_cast<std::uint32_t>(found - order.begin()));
        std::sort(camera.overlaps.begin(), camera.overlaps.end());
        cameras.push_back(std::move(camera));
    }
    return cameras;
}

}  // namespace versavis::client
