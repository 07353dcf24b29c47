// SPDX-License-Identifier: BSD-3-Clause
#include "board_configuration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "board_parts.hpp"
#include "keys.hpp"
#include "wire/limits.hpp"

namespace versavis::daemon {

namespace {

/// A period in nanoseconds times its rate in micro-hertz.
constexpr std::int64_t uhz_ns = 1'000'000'000'000'000;

/// The same with its rate in milli-hertz.
constexpr std::int64_t millihertz_ns = 1'000'000'000'000;

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

std::uint32_t milli_hertz(double hertz) {
    return static_cast<std::uint32_t>(std::llround(hertz * 1e3));
}

/// The wire has 32 bits for it. Rounding to whole nanoseconds, here and of the period,
/// must not carry it beyond what the board takes.
std::uint32_t short_ns(double us, std::int64_t maximum = wire::limits::longest_short_ns) {
    return static_cast<std::uint32_t>(std::min<std::int64_t>(std::llround(us * 1e3), maximum));
}

wire::CameraConfiguration board_camera(const CameraConfiguration& camera) {
    wire::CameraConfiguration out{};
    out.flags = wire::camera_enabled;
    if (camera.trigger_inverted) out.flags |= wire::camera_trigger_inverted;
    if (camera.strobe == Strobe::active_low) out.flags |= wire::camera_strobe_inverted;
    if (camera.strobe == Strobe::none) out.flags |= wire::camera_no_strobe;
    out.rate_uhz = micro_hertz(camera.rate_hz);
    const std::int64_t period_ns = uhz_ns / out.rate_uhz;
    out.phase_ns = short_ns(camera.phase_us, period_ns - 1);
    out.pulse_ns = short_ns(camera.pulse_us, period_ns / 2);
    out.latency_ns = short_ns(camera.latency_us + camera.board_output_ns * 1e-3,
                              std::min(period_ns - 1, wire::limits::longest_latency_ns));
    out.gap_ns = short_ns(camera.gap_us, period_ns - 1);
    out.glitch =
        static_cast<std::uint8_t>(std::llround(camera.glitch_us * 1e3 / wire::glitch_unit_ns));
    out.exposure_ns = std::llround(camera.exposure_us * 1e3);
    out.max_exposure_ns = std::llround(camera.max_exposure_us * 1e3);
    return out;
}

/// Half the period of what the test output shows.
std::int64_t longest_test_pulse_ns(const wire::Configuration& board) {
    const std::uint8_t test = board.ports.test;
    if (test == wire::test_none) return wire::limits::longest_short_ns;
    if (test == wire::test_rate) return millihertz_ns / board.ports.test_rate_millihertz / 2;
    if (test >= wire::test_imu0)
        return millihertz_ns / board.imus[test - wire::test_imu0].rate_millihertz / 2;
    return uhz_ns / board.cameras[test - wire::test_camera0].rate_uhz / 2;
}

/// One field is of two keys.
BoardKey key_of(wire::ConfigurationField field) {
    if (field == wire::ConfigurationField::port_options) return {"imu_output' or 'nmea"};
    return find_key(field).value_or(BoardKey{"an unknown key"});
}

/// The table that is refused; null: the file has none.
const TomlEntry* refused_entry(const Configuration& configuration, const wire::Refusal& refusal) {
    switch (refusal.part) {
        case wire::ConfigurationPart::camera: {
            const CameraConfiguration* camera = find_camera_at(configuration, refusal.index);
            return camera == nullptr ? nullptr : &camera->entry;
        }
        case wire::ConfigurationPart::imu: {
            const ImuConfiguration* imu = find_imu_at(configuration, refusal.index);
            return imu == nullptr ? nullptr : &imu->entry;
        }
        case wire::ConfigurationPart::illumination: return &configuration.illumination.entry;
        case wire::ConfigurationPart::ports: return &configuration.ports.entry;
    }
    return nullptr;
}

/// What the file calls a value that is a name there; empty: nothing.
std::string named(const Configuration& configuration, wire::ConfigurationField field,
                  std::int64_t value) {
    const auto camera_name = [&](std::int64_t output) {
        const CameraConfiguration* camera = find_camera_at(configuration, output);
        return camera == nullptr ? "" : camera->name;
    };
    if (field == wire::ConfigurationField::master) return camera_name(value);
    if (field == wire::ConfigurationField::imu_kind) {
        const imu::ImuModel* model = imu::find_model(static_cast<wire::ImuKind>(value));
        return model == nullptr ? "" : model->name;
    }
    if (field == wire::ConfigurationField::test_output) {
        for (const auto& [name, output] : test_outputs)
            if (output == value) return name;
        return "";
    }
    if (field != wire::ConfigurationField::test || value == wire::test_rate) return "";
    if (value < wire::test_imu0) return camera_name(value - wire::test_camera0);
    const ImuConfiguration* imu = find_imu_at(configuration, value - wire::test_imu0);
    return imu == nullptr ? "" : imu->name;
}

/// Most names that a field can hold.
constexpr std::int64_t most_names = 16;

std::string allowed(const Configuration& configuration, const wire::Refusal& refusal) {
    const auto [key, board_units] = key_of(refusal.field);
    if (refusal.minimum > refusal.maximum) return "no value";
    if (board_units != 0)
        return fmt::format("{:.10g} to {}", static_cast<double>(refusal.minimum) / board_units,
                           quantity(key, static_cast<double>(refusal.maximum) / board_units));
    std::vector<std::string> names;
    for (std::int64_t i = 0; i < most_names && i <= refusal.maximum - refusal.minimum; ++i)
        if (std::string name = named(configuration, refusal.field, refusal.minimum + i);
            !name.empty())
            names.push_back(std::move(name));
    return names.empty() ? "no such value" : fmt::format("{}", fmt::join(names, ", "));
}

/// The first of the options that the board does not take, by its key.
std::string describe_options(const wire::Refusal& refusal, const TomlEntry& entry) {
    const std::int64_t refused = refusal.value & ~refusal.maximum;
    const auto refused_by_key = [&](const char* key, const char* value) {
        return fmt::format("{} is {}: the board does not support that for this IMU",
                           entry.reference(key), value);
    };
    if ((refused & wire::imu_accel_ready) != 0) return refused_by_key("accel_ready", "true");
    if ((refused & wire::imu_i2c) != 0) return refused_by_key("bus", "\"i2c\"");
    if ((refused & wire::imu_i2c_second) != 0) return refused_by_key("i2c_address", "the second");
    return refused_by_key("data_ready", "true");
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
        port.rate_millihertz = milli_hertz(imu.rate_hz);
        port.filter = static_cast<std::uint8_t>(imu.filter);
        if (imu.data_ready) port.options |= wire::imu_data_ready;
        if (imu.accel_ready) port.options |= wire::imu_accel_ready;
        if (imu.bus == ImuBus::i2c) port.options |= wire::imu_i2c;
        if (imu.i2c_address == second_i2c_address) port.options |= wire::imu_i2c_second;
    }
    for (const std::string& name : configuration.illumination.cameras)
        out.illumination.cameras |=
            static_cast<std::uint8_t>(1U << find_triggered_camera(configuration, name)->output);
    if (configuration.illumination.inverted) out.illumination.flags |= wire::illumination_inverted;
    out.illumination.lead_ns = short_ns(configuration.illumination.lead_us);
    out.illumination.max_on_ns =
        std::max(short_ns(configuration.illumination.max_on_us),
                 out.illumination.lead_ns + wire::limits::shortest_light_ns);
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
    if (out.ports.test == wire::test_rate) {
        out.ports.test_rate_millihertz = milli_hertz(configuration.ports.test_rate_hz);
        out.ports.test_output = configuration.ports.test_output;
    }
    out.ports.sync_rate_uhz = micro_hertz(configuration.ports.sync_rate_hz);
    out.ports.pulse_ns = short_ns(configuration.ports.pulse_us, longest_test_pulse_ns(out));
    if (configuration.board.keep_configuration) out.flags |= wire::configuration_store;
    return out;
}

std::string describe(const Configuration& configuration, const wire::Refusal& refusal) {
    if (refusal.field == wire::ConfigurationField::present)
        return describe_missing(configuration, refusal);
    const auto [key, board_units] = key_of(refusal.field);
    const std::string name = named(configuration, refusal.field, refusal.value);
    const std::string value = board_units != 0
                                  ? quantity(key, static_cast<double>(refusal.value) / board_units)
                              : name.empty() ? "not known to the board"
                                             : fmt::format("\"{}\"", name);
    const TomlEntry* found = refused_entry(configuration, refusal);
    const TomlEntry entry = found == nullptr ? TomlEntry{} : *found;
    if (refusal.field == wire::ConfigurationField::imu_options)
        return describe_options(refusal, entry);
    return fmt::format("{} is {}: the board accepts {}", entry.reference(key), value,
                       allowed(configuration, refusal));
}

}  // namespace versavis::daemon
