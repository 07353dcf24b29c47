// SPDX-License-Identifier: BSD-3-Clause
#include "configuration_check.hpp"

namespace versavis::firmware {

namespace {

struct Range {
    wire::ConfigurationField field;
    std::int64_t value;
    std::int64_t minimum;
    std::int64_t maximum;
};

bool refuse(const Range& range, wire::ConfigurationAnswer& answer) {
    if (range.value >= range.minimum && range.value <= range.maximum) return false;
    answer.status = wire::ConfigurationStatus::out_of_range;
    answer.field = range.field;
    answer.minimum = range.minimum;
    answer.maximum = range.maximum;
    return true;
}

bool refuse_camera(const wire::CameraConfiguration& camera, wire::ConfigurationAnswer& answer) {
    using Field = wire::ConfigurationField;
    const std::int64_t period = camera.rate_uhz == 0 ? INT64_MAX : 1'000'000'000'000'000 / camera.rate_uhz;
    const Range ranges[] = {
        {Field::rate, camera.rate_uhz, 100'000, 1'000'000'000},
        {Field::phase, camera.phase_ns, 0, period - 1},
        {Field::pulse, camera.pulse_ns, 1'000, period / 2 < 10'000'000 ? period / 2 : 10'000'000},
        {Field::latency, camera.latency_ns, 0, period - 1 < 100'000'000 ? period - 1 : 100'000'000},
        {Field::gap, camera.gap_ns, 0, period - 1},
        {Field::exposure, camera.exposure_ns, 0, 10'000'000'000},
        {Field::max_exposure, camera.max_exposure_ns, 1'000, 10'000'000'000},
    };
    for (const Range& range : ranges)
        if (refuse(range, answer)) return true;
    return false;
}

}  // namespace

void check(const wire::Configuration& configuration, wire::ConfigurationAnswer& answer) {
    for (std::size_t i = 0; i < wire::camera_count; ++i) {
        const wire::CameraConfiguration& camera = configuration.cameras[i];
        answer.camera = static_cast<std::uint8_t>(i);
        if ((camera.flags & wire::camera_enabled) != 0 && refuse_camera(camera, answer)) return;
    }
    answer.camera = 0;
    if (configuration.imu.kind == wire::ImuKind::none) return;
    if (configuration.imu.kind != wire::ImuKind::adis16448b) {
        answer.status = wire::ConfigurationStatus::unknown_imu;
        answer.field = wire::ConfigurationField::imu_kind;
        return;
    }
    refuse({wire::ConfigurationField::imu_rate, configuration.imu.rate_uhz, 1'000'000, 1'000'000'000},
           answer);
}

}  // namespace versavis::firmware
