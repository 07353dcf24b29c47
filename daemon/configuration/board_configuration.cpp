// SPDX-License-Identifier: BSD-3-Clause
#include "configuration/board_configuration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace versavis::daemon {

namespace {

std::uint8_t pulse_inputs(const std::vector<std::string>& names) {
    unsigned mask = 0;
    for (const std::string& name : names)
        mask |= 1U << (std::find(pulse_input_names.begin(), pulse_input_names.end(), name) -
                       pulse_input_names.begin());
    return static_cast<std::uint8_t>(mask);
}

std::uint32_t micro_hertz(double hertz) {
    return static_cast<std::uint32_t>(std::llround(hertz * 1e6));
}
/// The wire has 32 bits for it: 4 s at most.
std::uint32_t short_ns(double us) {
    return static_cast<std::uint32_t>(std::llround(std::min(us * 1e3, 4e9)));
}

wire::CameraConfiguration board_camera(const CameraConfiguration& camera) {
    wire::CameraConfiguration out{};
    out.flags = wire::camera_enabled;
    if (camera.trigger_inverted) out.flags |= wire::camera_trigger_inverted;
    if (camera.strobe == Strobe::active_low) out.flags |= wire::camera_strobe_inverted;
    if (camera.strobe == Strobe::none) out.flags |= wire::camera_no_strobe;
    out.rate_uhz = micro_hertz(camera.rate_hz);
    // Rounded to whole nanoseconds, the phase must still be below the period.
    out.phase_ns = std::min(short_ns(camera.phase_us),
                            static_cast<std::uint32_t>(std::min(1e9 / camera.rate_hz, 4e9)) - 1);
    out.pulse_ns = short_ns(camera.pulse_us);
    out.latency_ns = short_ns(camera.latency_us + camera.board_output_ns * 1e-3);
    out.gap_ns = short_ns(camera.gap_us);
    out.exposure_ns = std::llround(camera.exposure_us * 1e3);
    out.max_exposure_ns = std::llround(camera.max_exposure_us * 1e3);
    return out;
}

/// Key of the configuration file, and the unit in which the board has it.
std::pair<const char*, const char*> field_name(wire::ConfigurationField field) {
    using Field = wire::ConfigurationField;
    switch (field) {
        case Field::rate: return {"rate_hz", "micro-hertz"};
        case Field::pulse: return {"pulse_us", "ns"};
        case Field::latency: return {"latency_us", "ns"};
        case Field::gap: return {"gap_us", "ns"};
        case Field::exposure: return {"exposure_us", "ns"};
        case Field::max_exposure: return {"max_exposure_us", "ns"};
        case Field::phase: return {"phase_us", "ns"};
        case Field::imu_kind: return {"model", "by number"};
        case Field::imu_rate: return {"rate_hz", "milli-hertz"};
        case Field::master: return {"master", "output of a camera"};
        case Field::imu_filter: return {"filter", "strength"};
        case Field::imu_options: return {"data_ready", "bits"};
        case Field::cameras: return {"cameras", "bits"};
        case Field::lead: return {"lead_us", "ns"};
        case Field::max_on: return {"max_on_us", "ns"};
        case Field::duty: return {"duty_percent", "ppm"};
        case Field::inputs: return {"inputs", "bits"};
        case Field::test: return {"test", "source"};
        case Field::sync_rate: return {"sync_rate_hz", "micro-hertz"};
        case Field::port_options:
            return {"imu_output' or 'nmea",
                    "bits; the one needs an IMU on the SPI port, the other none on the UART"};
        case Field::nmea_baud: return {"nmea_baud", "baud"};
    }
    return {"an unknown field", "?"};
}

}  // namespace

wire::Configuration board_configuration(const Configuration& configuration) {
    wire::Configuration out{};
    for (const CameraConfiguration& camera : configuration.cameras)
        if (camera.trigger == TriggerSource::board)
            out.cameras[camera.output] = board_camera(camera);
    for (const CameraConfiguration& camera : configuration.cameras) {
        if (camera.master.empty()) continue;
        wire::CameraConfiguration& slave = out.cameras[camera.output];
        slave.flags |= wire::camera_slave;
        slave.master =
            static_cast<std::uint8_t>(find_triggered_camera(configuration, camera.master)->output);
    }
    for (const ImuConfiguration& imu : configuration.imus) {
        wire::ImuConfiguration& port = out.imus[imu.port()];
        port.kind = imu.model->kind;
        port.rate_millihertz = static_cast<std::uint32_t>(std::llround(imu.rate_hz * 1e3));
        port.filter = static_cast<std::uint8_t>(imu.filter);
        if (imu.data_ready) port.options |= wire::imu_data_ready;
    }
    for (const std::string& name : configuration.illumination.cameras)
        out.illumination.cameras |=
            static_cast<std::uint8_t>(1U << find_triggered_camera(configuration, name)->output);
    if (configuration.illumination.inverted) out.illumination.flags |= wire::illumination_inverted;
    out.illumination.lead_ns = short_ns(configuration.illumination.lead_us);
    out.illumination.max_on_ns = short_ns(configuration.illumination.max_on_us);
    out.illumination.duty_ppm =
        static_cast<std::uint32_t>(std::llround(configuration.illumination.duty_percent * 1e4));
    out.ports.inputs = pulse_inputs(configuration.ports.inputs);
    out.ports.falling = pulse_inputs(configuration.ports.falling);
    if (configuration.ports.imu_output) out.ports.options |= wire::port_imu_output;
    if (configuration.ports.nmea) {
        out.ports.options |= wire::port_nmea;
        out.ports.nmea_baud = configuration.ports.nmea_baud;
    }
    out.ports.test = test_source(configuration).value_or(wire::test_none);
    out.ports.sync_rate_uhz = micro_hertz(configuration.ports.sync_rate_hz);
    out.ports.pulse_ns = short_ns(configuration.ports.pulse_us);
    if (configuration.board.keep_configuration) out.flags |= wire::configuration_store;
    return out;
}

std::string describe(const wire::Refusal& refusal) {
    const char* table = "[ports]";
    switch (refusal.part) {
        case wire::ConfigurationPart::camera: table = "the camera at output"; break;
        case wire::ConfigurationPart::imu: table = "the IMU at port"; break;
        case wire::ConfigurationPart::illumination: table = "[illumination]"; break;
        case wire::ConfigurationPart::ports: break;
    }
    const bool numbered = refusal.part == wire::ConfigurationPart::camera ||
                          refusal.part == wire::ConfigurationPart::imu;
    const auto [key, unit] = field_name(refusal.field);
    return fmt::format("'{}' of {}{} is {}: allowed are {} to {} ({})", key, table,
                       numbered ? fmt::format(" {}", refusal.index) : "", refusal.value,
                       refusal.minimum, refusal.maximum, unit);
}

}  // namespace versavis::daemon
