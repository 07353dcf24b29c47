// SPDX-License-Identifier: BSD-3-Clause
#include "configuration_check.hpp"

#include "imu/imu_part.hpp"
#include "imu/vn100.hpp"
#include "wire/limits.hpp"

namespace versavis::firmware {

namespace {

namespace limits = wire::limits;
using Field = wire::ConfigurationField;
using Part = wire::ConfigurationPart;

constexpr std::int64_t uhz_ns = 1'000'000'000'000'000;
constexpr std::int64_t mhz_ns = 1'000'000'000'000;

std::int64_t min(std::int64_t a, std::int64_t b) { return a < b ? a : b; }

/// One part of the configuration.
class Checker {
 public:
    Checker(Part part, std::size_t index, const PortFacts& facts, RefusalSink& sink)
        : part_(part), index_(static_cast<std::uint8_t>(index)), facts_(facts), sink_(sink) {}

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

    /// The same of small numbers, whose code is shorter.
    void small(Field field, std::uint32_t value, std::uint32_t minimum, std::uint32_t maximum) {
        range(field, value, minimum, maximum);
    }

    /// Refuses what is `used` of the board and is not there; `bit` of wire::Present.
    void need(bool used, unsigned bit) {
        if (used && (facts_.present >> bit & 1U) == 0)
            range(Field::present, static_cast<std::int64_t>(bit), 0, -1);
    }

    const PortFacts& facts() const { return facts_; }

 private:
    Part part_;
    std::uint8_t index_;
    const PortFacts& facts_;
    RefusalSink& sink_;
};

/// Position of the only bit of `present`.
constexpr unsigned bit_of(std::uint32_t present) {
    unsigned bit = 0;
    while (present >> bit != 1U) ++bit;
    return bit;
}

bool enabled(const wire::CameraConfiguration& camera) {
    return (camera.flags & wire::camera_enabled) != 0;
}
bool slave(const wire::CameraConfiguration& camera) {
    return (camera.flags & wire::camera_slave) != 0;
}

/// A master has an exposure line and a schedule of its own.
bool can_be_master(const wire::Configuration& configuration, std::size_t master) {
    if (master >= wire::camera_count) return false;
    const wire::CameraConfiguration& camera = configuration.cameras[master];
    return enabled(camera) && !slave(camera) && (camera.flags & wire::camera_no_strobe) == 0;
}

void check_master(const wire::Configuration& configuration, std::size_t index, Checker& checker) {
    const std::int64_t master = configuration.cameras[index].master;
    if (!slave(configuration.cameras[index]) ||
        can_be_master(configuration, static_cast<std::size_t>(master)))
        return;
    std::int64_t possible = -1;
    for (std::size_t i = 0; i < wire::camera_count && possible < 0; ++i)
        if (can_be_master(configuration, i)) possible = static_cast<std::int64_t>(i);
    // The range names the cameras that could be one; if empty, none can.
    checker.range(Field::master, master, possible < 0 ? 0 : possible, possible);
}

void check_camera(const wire::Configuration& configuration, std::size_t index, Checker checker) {
    const wire::CameraConfiguration& camera = configuration.cameras[index];
    checker.need(true, bit_of(wire::present_camera0) + static_cast<unsigned>(index));
    const std::int64_t period = camera.rate_uhz == 0 ? INT64_MAX : uhz_ns / camera.rate_uhz;
    checker.small(Field::rate, camera.rate_uhz, limits::slowest_camera_uhz,
                  limits::fastest_camera_uhz);
    checker.range(Field::phase, camera.phase_ns, 0, period - 1);
    checker.range(Field::pulse, camera.pulse_ns, limits::shortest_pulse_ns,
                  min(period / 2, limits::longest_pulse_ns));
    checker.range(Field::latency, camera.latency_ns, 0,
                  min(period - 1, limits::longest_latency_ns));
    checker.range(Field::gap, camera.gap_ns, 0, period - 1);
    checker.range(Field::exposure, camera.exposure_ns, 0, limits::longest_exposure_ns);
    checker.range(Field::max_exposure, camera.max_exposure_ns, limits::shortest_max_exposure_ns,
                  limits::longest_exposure_ns);
    check_master(configuration, index, checker);
}

void check_uart_imu(const wire::ImuConfiguration& imu, Checker checker) {
    const auto only = static_cast<std::int64_t>(wire::ImuKind::vn100);
    const bool data_ready = (imu.options & wire::imu_data_ready) != 0;
    checker.need(true, bit_of(wire::present_uart));
    checker.need(data_ready, bit_of(wire::present_ready0) + 1);
    checker.range(Field::imu_kind, static_cast<std::int64_t>(imu.kind), only, only);
    checker.range(Field::imu_rate, imu.rate_millihertz, limits::slowest_imu_millihertz,
                  min(vn100::fastest_millihertz, checker.facts().fastest_imu_millihertz));
    checker.small(Field::imu_filter, imu.filter, 0, 0);
    checker.small(Field::imu_options, imu.options, 0, wire::imu_data_ready);
}

/// The options that a part can have, as far as the others allow them.
std::uint8_t possible_options(const ImuPart& part, std::uint8_t options) {
    unsigned possible = wire::imu_data_ready;
    if ((options & wire::imu_data_ready) != 0 && part.accel_millihertz() != 0)
        possible |= wire::imu_accel_ready;
    // A reading takes so long there that it must begin with the data.
    if ((options & wire::imu_data_ready) != 0 && part.fastest_i2c_millihertz() != 0)
        possible |= wire::imu_i2c;
    if ((possible & options & wire::imu_i2c) != 0) possible |= wire::imu_i2c_second;
    return static_cast<std::uint8_t>(possible);
}

void check_spi_imu(const wire::ImuConfiguration& imu, Checker checker) {
    const ImuPart* part = find_part(imu.kind);
    if (part == nullptr)
        return checker.range(Field::imu_kind, static_cast<std::int64_t>(imu.kind), 1,
                             static_cast<std::int64_t>(wire::ImuKind::bmi088));
    const std::uint8_t possible = possible_options(*part, imu.options);
    if ((imu.options & ~possible) != 0)
        return checker.small(Field::imu_options, imu.options, 0, possible & imu.options);
    const bool data_ready = (imu.options & wire::imu_data_ready) != 0;
    const bool i2c = (imu.options & wire::imu_i2c) != 0;
    checker.need(true, bit_of(i2c ? wire::present_i2c : wire::present_spi));
    checker.need(data_ready, bit_of(wire::present_ready0));
    checker.need((imu.options & wire::imu_accel_ready) != 0, bit_of(wire::present_accel_ready));
    const std::int64_t fastest =
        min(i2c ? part->fastest_i2c_millihertz() : part->fastest_millihertz(),
            checker.facts().fastest_imu_millihertz);
    checker.range(
        Field::imu_rate, imu.rate_millihertz, limits::slowest_imu_millihertz,
        data_ready ? fastest : min(fastest, limits::fastest_imu_without_data_ready_millihertz));
    checker.small(Field::imu_filter, imu.filter, 0, part->strongest_filter());
}

void check_illumination(const wire::IlluminationConfiguration& light, Checker checker) {
    if (light.cameras == 0) return;
    checker.need(true, bit_of(wire::present_light));
    checker.small(Field::cameras, light.cameras, 1, (1 << wire::camera_count) - 1);
    checker.small(Field::lead, light.lead_ns, 0, limits::longest_lead_ns);
    checker.range(Field::max_on, light.max_on_ns,
                  limits::shortest_light_ns + std::int64_t{light.lead_ns},
                  limits::longest_light_ns);
    checker.small(Field::duty, light.duty_ppm, 1, 1'000'000);
}

/// Where pulses at a rate of their own leave, and how fast.
void check_test_rate(const wire::Configuration& configuration, Checker& checker) {
    const wire::PortConfiguration& ports = configuration.ports;
    checker.small(Field::test_rate, ports.test_rate_millihertz, limits::slowest_test_millihertz,
                  limits::fastest_test_millihertz);
    checker.small(Field::test_output, ports.test_output, 0, wire::test_at_sync);
    if (ports.test_output == wire::test_at_test)
        return checker.need(true, bit_of(wire::present_test_output));
    if (ports.test_output == wire::test_at_sync) {
        checker.need(true, bit_of(wire::present_sync_output));
        checker.small(Field::test_output, ports.test_output, 0,
                      ports.sync_rate_uhz == 0 ? wire::test_at_sync : wire::test_at_sync - 1);
    } else if (ports.test_output < wire::test_at_sync) {
        const unsigned camera = ports.test_output - wire::test_at_camera0;
        checker.need(true, bit_of(wire::present_camera0) + camera);
        if (enabled(configuration.cameras[camera]))  // it uses the output
            checker.small(Field::test_output, ports.test_output, 0, 0);
    }
}

/// What the test output can show, and how wide its pulses may be.
void check_test(const wire::Configuration& configuration, Checker& checker) {
    const wire::PortConfiguration& ports = configuration.ports;
    const wire::ImuConfiguration& uart_imu = configuration.imus[1];
    const bool uart_ticks =
        (uart_imu.options & wire::imu_data_ready) != 0;  // nothing else shows its ticks
    if (ports.test == wire::test_none) return;
    const int last = wire::test_imu0 + (uart_ticks ? 1 : 0);
    std::int64_t period = limits::longest_pulse_ns * 2;
    if (ports.test == wire::test_rate) {
        check_test_rate(configuration, checker);
        if (ports.test_rate_millihertz != 0) period = mhz_ns / ports.test_rate_millihertz;
    } else if (ports.test > last) {
        return checker.range(Field::test, ports.test, 0, last);
    } else if (ports.test >= wire::test_imu0) {
        checker.need(true, bit_of(wire::present_test_output));
        const std::uint32_t rate = configuration.imus[ports.test - wire::test_imu0].rate_millihertz;
        if (rate != 0) period = mhz_ns / rate;
    } else {
        checker.need(true, bit_of(wire::present_test_output));
        const std::uint32_t rate = configuration.cameras[ports.test - wire::test_camera0].rate_uhz;
        if (rate != 0) period = uhz_ns / rate;
    }
    checker.range(Field::pulse, ports.pulse_ns, limits::shortest_pulse_ns,
                  min(limits::longest_pulse_ns, period / 2));
}

void check_ports(const wire::Configuration& configuration, Checker checker) {
    const wire::PortConfiguration& ports = configuration.ports;
    checker.small(Field::inputs, ports.inputs, 0, (1 << wire::pulse_input_count) - 1);
    for (unsigned input = 0; input < wire::pulse_input_count; ++input)
        checker.need((ports.inputs >> input & 1U) != 0, bit_of(wire::present_pulse0) + input);
    check_test(configuration, checker);
    if (ports.sync_rate_uhz != 0) {
        checker.need(true, bit_of(wire::present_sync_output));
        checker.small(Field::sync_rate, ports.sync_rate_uhz, limits::slowest_sync_uhz,
                      limits::fastest_sync_uhz);
        checker.range(Field::pulse, ports.pulse_ns, limits::shortest_pulse_ns,
                      limits::longest_pulse_ns);
    }
    if ((ports.options & wire::port_imu_output) != 0) {
        checker.need(true, bit_of(wire::present_imu_output));
        if (configuration.imus[0].kind == wire::ImuKind::none)
            checker.small(Field::port_options, ports.options, 0, 0);
    }
    if ((ports.options & wire::port_nmea) == 0) return;
    checker.need(true, bit_of(wire::present_uart));
    if (configuration.imus[1].kind != wire::ImuKind::none)  // it occupies the UART
        checker.small(Field::port_options, ports.options, 0, wire::port_imu_output);
    if (ports.nmea_baud != 0)
        checker.small(Field::nmea_baud, ports.nmea_baud, limits::slowest_nmea_baud,
                      limits::fastest_nmea_baud);
}

}  // namespace

void check(const wire::Configuration& configuration, const PortFacts& facts, RefusalSink& sink) {
    const auto checker = [&](Part part, std::size_t index) {
        return Checker(part, index, facts, sink);
    };
    for (std::size_t i = 0; i < wire::camera_count; ++i)
        if (enabled(configuration.cameras[i]))
            check_camera(configuration, i, checker(Part::camera, i));
    if (configuration.imus[0].kind != wire::ImuKind::none)
        check_spi_imu(configuration.imus[0], checker(Part::imu, 0));
    if (configuration.imus[1].kind != wire::ImuKind::none)
        check_uart_imu(configuration.imus[1], checker(Part::imu, 1));
    check_illumination(configuration.illumination, checker(Part::illumination, 0));
    check_ports(configuration, checker(Part::ports, 0));
    checker(Part::ports, 0)
        .need((configuration.flags & wire::configuration_store) != 0, bit_of(wire::present_memory));
}

}  // namespace versavis::firmware
