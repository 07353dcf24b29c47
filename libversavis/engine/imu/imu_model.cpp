// SPDX-License-Identifier: BSD-3-Clause
#include "engine/imu/imu_model.hpp"

#include <array>
#include <limits>

namespace versavis::imu {

namespace {

constexpr double radians_per_degree = 3.14159265358979323846 / 180;
constexpr double standard_gravity = 9.80665;

constexpr double deg_s = radians_per_degree;
constexpr double g = standard_gravity;
constexpr double gauss = 1e-4;
constexpr double two_to_the(int exponent) {
    return exponent == 0 ? 1 : two_to_the(exponent + 1) / 2;
}

// From the data sheets: gyro, accelerometer, magnetometer, pressure and temperature per LSB,
// temperature at zero. The VN-100's floats come as whole numbers of powers of two
// (docs/contracts/wire-protocol.md).
constexpr std::array<ImuModel, 8> models{{
    {wire::ImuKind::adis16448b, "adis16448b", 0.04 * deg_s, g / 1200, gauss / 7000, 2.0, 0.07386,
     31.0},
    {wire::ImuKind::adis16448a, "adis16448a", 0.04 * deg_s, g / 1200, gauss / 7000, 2.0, 0.07386,
     31.0},
    {wire::ImuKind::adis16445, "adis16445", 0.01 * deg_s, 0.00025 * g, 0, 0, 0.07386, 31.0},
    {wire::ImuKind::adis16460, "adis16460", 0.005 * deg_s, 0.00025 * g, 0, 0, 0.05, 25.0},
    {wire::ImuKind::adis16470, "adis16470", 0.1 * deg_s, 0.00125 * g, 0, 0, 0.1, 0.0},
    {wire::ImuKind::icm42688p, "icm42688p", deg_s / 16.4, g / 2048, 0, 0, 1 / 132.48, 25.0},
    {wire::ImuKind::bmi088, "bmi088", 2000 * deg_s / 32768, 24 * g / 32768, 0, 0, 0.125, 23.0},
    {wire::ImuKind::vn100, "vn100", two_to_the(-24), two_to_the(-20), gauss* two_to_the(-13),
     1000 * two_to_the(-8), two_to_the(-7), 0.0},
}};

template <class Matches>
const ImuModel* find(Matches matches) {
    for (const ImuModel& model : models)
        if (matches(model)) return &model;
    return nullptr;
}

}  // namespace

std::vector<std::string> model_names() {
    std::vector<std::string> names;
    for (const ImuModel& model : models) names.emplace_back(model.name);
    return names;
}

const ImuModel* find_model(wire::ImuKind kind) {
    return find([&](const ImuModel& model) { return model.kind == kind; });
}

const ImuModel* find_model(const std::string& name) {
    return find([&](const ImuModel& model) { return model.name == name; });
}

ImuMetadata to_si(const ImuModel& model, const wire::ImuSample& sample) {
    constexpr float none = std::numeric_limits<float>::quiet_NaN();
    ImuMetadata metadata{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        metadata.gyro[axis] = static_cast<float>(sample.gyro[axis] * model.gyro_rad_s);
        metadata.accel[axis] = static_cast<float>(sample.accel[axis] * model.accel_m_s2);
        metadata.magnetic[axis] =
            model.magnetic_t == 0 ? none
                                  : static_cast<float>(sample.magnetic[axis] * model.magnetic_t);
    }
    metadata.temperature =
        static_cast<float>(sample.temperature * model.temperature_c + model.temperature_at_zero_c);
    metadata.pressure =
        model.pressure_pa == 0 ? none : static_cast<float>(sample.pressure * model.pressure_pa);
    const bool faulty = (sample.flags & (wire::imu_check_failed | wire::imu_self_test_failed)) != 0;
    metadata.flags = faulty ? std::uint32_t{flag_sensor_error} : 0;
    return metadata;
}

}  // namespace versavis::imu
