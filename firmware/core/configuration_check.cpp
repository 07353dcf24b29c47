// SPDX-License-Identifier: BSD-3-Clause
#include "configuration_check.hpp"

#include "imu/imu_part.hpp"
#include "imu/vn100.hpp"

namespace versavis::firmware {

namespace {

using Field = wire::ConfigurationField;
using Part = wire::ConfigurationPart;

constexpr std::int64_t uhz_ns = 1'000'000'000'000'000;
constexpr std::int64_t longest_exposure = 10'000'000'000;
constexpr std::int64_t longest_pulse = 10'000'000;

std::int64_t min(std::int64_t a, std::int64_t b) { return a < b ? a : b; }

/// One part of the configuration.
class Checker {
 public:
    Checker(Part part, std::size_t index, RefusalSink& sink)
        : part_(part), index_(static_cast<std::uint8_t>(index)), sink_(sink) {}

    void range(Field field, std::int64_t value, std::int64_t minimum, std::int64_t maximum) {
        if (value >= minimum && value <= maximum) return;
        wire::Refusal refusal{};
        refusal.part = part_;
        refusal.index = index_;
        refusal.field = field;
        refusal.value = value;
        refusal.minimum = minimum;
        refusal.maximum = maximum;
        sink_.refuse(refusal);
    }

 private:
    Part part_;
    std::uint8_t index_;
    RefusalSink& sink_;
};

bool enabled(const wire::CameraConfiguration& camera) {
    return (camera.flags & wire::camera_enabled) != 0;
}
bool slave(const wire::CameraConfiguration& camera) {
    return (camera.flags & wire::camera_slave) != 0;
}

/// A master has an exposure line and a schedule of its own.
bool can_be_master(const wire::Configuration& configuration, std::size_t master,
                   std::size_t slave_index) {
    if (master >= wire::camera_count || master == slave_index) return false;
    const wire::CameraConfiguration& camera = configuration.cameras[master];
    return enabled(camera) && !slave(camera) && (camera.flags & wire::camera_no_strobe) == 0;
}

void check_master(const wire::Configuration& configuration, std::size_t index, Checker& checker) {
    const std::int64_t master = configuration.cameras[index].master;
    if (!slave(configuration.cameras[index]) ||
        can_be_master(configuration, static_cast<std::size_t>(master), index))
        return;
    std::int64_t possible = -1;
    for (std::size_t i = 0; i < wire::camera_count && possible < 0; ++i)
        if (can_be_master(configuration, i, index)) possible = static_cast<std::int64_t>(i);
    // The range names the cameras that could be one; if empty, none can.
    checker.range(Field::master, master == possible ? -1 : master, possible < 0 ? 0 : possible,
                  possible);
}

void check_camera(const wire::Configuration& configuration, std::size_t index, RefusalSink& sink) {
    const wire::CameraConfiguration& camera = configuration.cameras[index];
    Checker checker(Part::camera, index, sink);
    const std::int64_t period = camera.rate_uhz == 0 ? INT64_MAX : uhz_ns / camera.rate_uhz;
    checker.range(Field::rate, camera.rate_uhz, 100'000, 1'000'000'000);
    checker.range(Field::phase, camera.phase_ns, 0, period - 1);
    checker.range(Field::pulse, camera.pulse_ns, 1'000, min(period / 2, longest_pulse));
    checker.range(Field::latency, camera.latency_ns, 0, min(period - 1, 100'000'000));
    checker.range(Field::gap, camera.gap_ns, 0, period - 1);
    checker.range(Field::exposure, camera.exposure_ns, 0, longest_exposure);
    checker.range(Field::max_exposure, camera.max_exposure_ns, 1'000, longest_exposure);
    check_master(configuration, index, checker);
}

void check_imu(const wire::ImuConfiguration& imu, std::size_t port, RefusalSink& sink) {
    if (imu.kind == wire::ImuKind::none) return;
    Checker checker(Part::imu, port, sink);
    if (port == 1) {
        const auto only = static_cast<std::int64_t>(wire::ImuKind::vn100);
        checker.range(Field::imu_kind, static_cast<std::int64_t>(imu.kind), only, only);
        checker.range(Field::imu_rate, imu.rate_millihertz, 1'000, vn100::fastest_millihertz);
        checker.range(Field::imu_filter, imu.filter, 0, 0);
        return;
    }
    const ImuPart* part = find_part(imu.kind);
    if (part == nullptr)
        return checker.range(Field::imu_kind, static_cast<std::int64_t>(imu.kind), 1,
                             static_cast<std::int64_t>(wire::ImuKind::bmi088));
    const bool data_ready = (imu.options & wire::imu_data_ready) != 0;
    const std::int64_t fastest = part->fastest_millihertz();
    checker.range(Field::imu_rate, imu.rate_millihertz, 1'000,
                  data_ready ? fastest : min(fastest, 1'000'000));
    checker.range(Field::imu_filter, imu.filter, 0, part->strongest_filter());
}

void check_illumination(const wire::IlluminationConfiguration& light, RefusalSink& sink) {
    if (light.cameras == 0) return;
    Checker checker(Part::illumination, 0, sink);
    checker.range(Field::cameras, light.cameras, 1, (1 << wire::camera_count) - 1);
    checker.range(Field::lead, light.lead_ns, 0, 1'000'000);
    checker.range(Field::max_on, light.max_on_ns, 10'000 + std::int64_t{light.lead_ns},
                  1'000'000'000);
    checker.range(Field::duty, light.duty_ppm, 1, 1'000'000);
}

/// What the test output can show, and how wide its pulses may be.
void check_test(const wire::Configuration& configuration, Checker& checker) {
    const wire::PortConfiguration& ports = configuration.ports;
    const wire::ImuConfiguration& uart_imu = configuration.imus[1];
    const bool uart_ticks =
        (uart_imu.options & wire::imu_data_ready) != 0;  // nothing else shows its ticks
    const int last = wire::test_imu0 + (uart_ticks ? 1 : 0);
    checker.range(Field::test, ports.test, 0, last);
    if (ports.test == wire::test_none || ports.test > last) return;
    std::int64_t period = longest_pulse * 2;
    if (ports.test >= wire::test_imu0) {
        const std::uint32_t rate = configuration.imus[ports.test - wire::test_imu0].rate_millihertz;
        if (rate != 0) period = 1'000'000'000'000 / rate;
    } else {
        const std::uint32_t rate = configuration.cameras[ports.test - wire::test_camera0].rate_uhz;
        if (rate != 0) period = uhz_ns / rate;
    }
    checker.range(Field::pulse, ports.pulse_ns, 1'000, min(longest_pulse, period / 2));
}

void check_ports(const wire::Configuration& configuration, RefusalSink& sink) {
    const wire::PortConfiguration& ports = configuration.ports;
    Checker checker(Part::ports, 0, sink);
    checker.range(Field::inputs, ports.inputs, 0, (1 << wire::pulse_input_count) - 1);
    check_test(configuration, checker);
    if (ports.sync_rate_uhz != 0) {
        checker.range(Field::sync_rate, ports.sync_rate_uhz, 100'000, 10'000'000);
        checker.range(Field::pulse, ports.pulse_ns, 1'000, longest_pulse);
    }
    if ((ports.options & wire::port_imu_output) != 0 &&
        configuration.imus[0].kind == wire::ImuKind::none)
        checker.range(Field::port_options, ports.options, 0, 0);
    if ((ports.options & wire::port_nmea) == 0) return;
    if (configuration.imus[1].kind != wire::ImuKind::none)  // it occupies the UART
        checker.range(Field::port_options, ports.options, 0, wire::port_imu_output);
    if (ports.nmea_baud != 0) checker.range(Field::nmea_baud, ports.nmea_baud, 1'200, 921'600);
}

}  // namespace

void check(const wire::Configuration& configuration, RefusalSink& sink) {
    for (std::size_t i = 0; i < wire::camera_count; ++i)
        if (enabled(configuration.cameras[i])) check_camera(configuration, i, sink);
    for (std::size_t i = 0; i < wire::imu_count; ++i) check_imu(configuration.imus[i], i, sink);
    check_illumination(configuration.illumination, sink);
    check_ports(configuration, sink);
}

}  // namespace versavis::firmware
