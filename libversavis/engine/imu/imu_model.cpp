// SPDX-License-Identifier: BSD-3-Clause
#include "engine/imu/imu_model.hpp"

#include <array>
#include <limits>

#include "wire/imu_scale.hpp"

namespace versavis::imu {

namespace {

constexpr std::array<ImuModel, 8> models{{
    {"adis16448b", wire::ImuKind::adis16448b, 819.2, 6},
    {"adis16448a", wire::ImuKind::adis16448a, 819.2, 6},
    {"adis16445", wire::ImuKind::adis16445, 819.2, 6},
    {"adis16460", wire::ImuKind::adis16460, 2048, 6},
    {"adis16470", wire::ImuKind::adis16470, 2000, 6},
    {"icm42688p", wire::ImuKind::icm42688p, 8000, 7},
    {"bmi088", wire::ImuKind::bmi088, 2000, 2},
    {"vn100", wire::ImuKind::vn100, 800, 0},
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
    const wire::ImuScale scale = wire::imu_scale(model.kind);
    ImuMetadata metadata{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        metadata.gyro[axis] = static_cast<float>(sample.gyro[axis] * scale.gyro_rad_s);
        metadata.accel[axis] = static_cast<float>(sample.accel[axis] * scale.accel_m_s2);
        metadata.magnetic[axis] =
            scale.magnetic_t == 0 ? none
                                  : static_cast<float>(sample.magnetic[axis] * scale.magnetic_t);
    }
    metadata.temperature =
        static_cast<float>(sample.temperature * scale.temperature_c + scale.temperature_at_zero_c);
    metadata.pressure =
        scale.pressure_pa == 0 ? none : static_cast<float>(sample.pressure * scale.pressure_pa);
    const bool faulty = (sample.flags & (wire::imu_check_failed | wire::imu_self_test_failed)) != 0;
    metadata.flags = faulty ? std::uint32_t{flag_sensor_error} : 0;
    return metadata;
}

}  // namespace versavis::imu
