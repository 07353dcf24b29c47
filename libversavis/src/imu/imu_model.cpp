// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/imu/imu_model.hpp"

#include <array>
#include <limits>

namespace versavis::imu {

namespace {

constexpr double radians_per_degree = 3.14159265358979323846 / 180;
constexpr double standard_gravity = 9.80665;

// ADIS16448: 0.04 deg/s, 1/1200 g, 142.9 microgauss, 20 microbar and 0.07386 degree C per LSB, 31 degree C at
// zero.
constexpr std::array<ImuModel, 1> models{{
    {wire::ImuKind::adis16448b, "adis16448b", 0.04 * radians_per_degree, standard_gravity / 1200, 142.9e-10,
     2.0, 0.07386, 31.0},
}};

template <class Matches>
const ImuModel* find(Matches matches) {
    for (const ImuModel& model : models)
        if (matches(model)) return &model;
    return nullptr;
}

}  // namespace

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
            model.magnetic_t == 0 ? none : static_cast<float>(sample.magnetic[axis] * model.magnetic_t);
    }
    metadata.temperature =
        static_cast<float>(sample.temperature * model.temperature_c + model.temperature_at_zero_c);
    metadata.pressure =
        model.pressure_pa == 0 ? none : static_cast<float>(sample.pressure * model.pressure_pa);
    const bool faulty = (sample.flags & (wire::imu_checksum_failed | wire::imu_self_test_failed)) != 0;
    metadata.flags = faulty ? std::uint32_t{flag_sensor_error} : 0;
    return metadata;
}

}  // namespace versavis::imu
