// SPDX-License-Identifier: BSD-3-Clause
#include "engine/imu/imu_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "wire/imu_scale.hpp"

namespace versavis::imu {

namespace {

/// A sample takes 0.4 ms on I2C at 400 kHz. At half, rates that work are refused; at twice, one
/// would hardly be over when the next is due.
constexpr double fastest_i2c_hz = 1000;

constexpr std::array<ImuModel, 8> models{{
    {"adis16448b", wire::ImuKind::adis16448b, 819.2, 6, 0, false, 330},
    {"adis16448a", wire::ImuKind::adis16448a, 819.2, 6, 0, false, 330},
    {"adis16445", wire::ImuKind::adis16445, 819.2, 6, 0, false, 330},
    {"adis16460", wire::ImuKind::adis16460, 2048, 6, 0, false, 375},
    {"adis16470", wire::ImuKind::adis16470, 2000, 6, 0, false, 550},
    {"icm42688p", wire::ImuKind::icm42688p, 8000, 7, fastest_i2c_hz},
    {"bmi088", wire::ImuKind::bmi088, 2000, 2, 0, true},
    {"vn100", wire::ImuKind::vn100, 800, 0},
}};

template <class Matches>
const ImuModel* find(Matches matches) {
    for (const ImuModel& model : models)
        if (matches(model)) return &model;
    return nullptr;
}

/// Delay of the element of an ADIS, in periods of its bandwidth. The maker states two poles for the
/// ADIS16364, 404 and 757 Hz (EngineerZone, "Gyro filter delay"): together 332 Hz, as its data
/// sheet says, and 0.604 ms.
constexpr double element_periods = 0.2;

/// Share of it by which the element of another part may differ: 0.16 periods are of one pole alone,
/// and bandwidths are typical values.
constexpr double element_spread = 0.25;

/// How well the digital filters of an ADIS are known: the published offsets of the ADIS16448 with 4
/// and 16 taps, less that with one, are off by 0.05 to 0.14 ms.
constexpr Duration adis_rest = microseconds(100);

/// An ICM-42688-P delays by its UI filters, of second order after a reset (data sheet 1.8, 5.5, the
/// tables of group delay). Below 2 kHz the codes from 1 on are parts of the larger of the rate and
/// 400 Hz, for which they delay so; code 0 is half of the rate, from 25 Hz on.
constexpr std::array<double, 8> icm42688p_ms_at_400_hz{0, 5.1, 5.8, 8.0, 9.1, 12.9, 15.3, 30.0};
constexpr double icm42688p_periods_of_code_0 = 0.643;
constexpr double icm42688p_periods_when_fast = 1.6;
/// Before them is an anti-alias filter of second order, after a reset at 585 Hz (5.3, 15.3): for
/// the angular rate 0.225 periods.
constexpr double icm42688p_alias_s = 0.225 / 585;
/// The tables round to 0.1 ms, and the notch filter, trimmed to 1 to 3 kHz, adds 0.01 to 0.1 ms.
constexpr Duration icm42688p_rest = microseconds(100);

/// Delay of a low-pass filter of unknown shape, in periods of its bandwidth: 0.16 with one pole,
/// 0.22 with two or with a plain average, more with more poles. At half, the true delay is often
/// beyond one sigma; at twice, a part looks worse than any filter could make it.
constexpr double periods_of_bandwidth = 0.3;

/// The VN-100 averages its samples, 800 a second, over windows that are its owner's to set; a
/// window of four, as it is delivered with, delays by 1.9 ms. At half, that is not covered; at
/// twice, a part without averages looks worse than it is.
constexpr Duration vn100_window = milliseconds(2);

/// Rate at which the part runs: the board lets one that it does not follow run at four times the
/// rate at which it is read.
double part_rate(double rate_hz, bool data_ready) { return data_ready ? rate_hz : 4 * rate_hz; }

bool is_adis(const ImuModel& model) {
    using wire::ImuKind;
    constexpr std::array kinds{ImuKind::adis16445, ImuKind::adis16448a, ImuKind::adis16448b,
                               ImuKind::adis16460, ImuKind::adis16470};
    return std::find(kinds.begin(), kinds.end(), model.kind) != kinds.end();
}

/// How many samples of its own an ADIS averages for one of its output: any number, or for the
/// older ones a power of two.
double adis_averaged(const ImuModel& model, double rate_hz) {
    using wire::ImuKind;
    const bool any = model.kind == ImuKind::adis16460 || model.kind == ImuKind::adis16470;
    const auto parts = std::llround(model.fastest_hz * 1e3) / std::llround(rate_hz * 1e3);
    const double whole = static_cast<double>(std::clamp(parts, 1LL, any ? 2000LL : 1024LL));
    return any ? whole : std::exp2(std::floor(std::log2(whole)));
}

/// The slowest that is not below the wanted one, as the board sets it up.
double icm42688p_rate(double wanted_hz) {
    constexpr std::array<double, 10> rates{12.5, 25, 50, 100, 200, 500, 1000, 2000, 4000, 8000};
    const auto* const found = std::lower_bound(rates.begin(), rates.end(), wanted_hz);
    return found == rates.end() ? rates.back() : *found;
}

/// BMI088, GYRO_BANDWIDTH, the widest at each rate; its accelerometer has 131 Hz at least.
double bmi088_bandwidth_hz(double rate_hz) {
    constexpr std::array<std::array<double, 2>, 4> widest{
        {{100, 32}, {200, 64}, {400, 47}, {1000, 116}}};
    for (const auto& [rate, bandwidth] : widest)
        if (rate_hz <= rate) return bandwidth;
    return 131;
}

Duration from_s(double seconds) { return {std::llround(seconds * 1e9)}; }

/// By their data sheets: the element, two averages in a row over 2^filter samples (a Bartlett
/// window), then one over the samples that make one of the output.
FilterDelay adis_delay(const ImuModel& model, unsigned filter, double rate_hz) {
    const double samples = std::exp2(filter) - 1 + (adis_averaged(model, rate_hz) - 1) / 2;
    const double element_s = element_periods / model.element_hz;
    const double rest_s = static_cast<double>(adis_rest.ns) * 1e-9;
    return {from_s(samples / model.fastest_hz + element_s),
            from_s(std::hypot(rest_s, element_spread * element_s)), FilterDelaySource::model};
}

FilterDelay icm42688p_delay(unsigned filter, double wanted_hz) {
    const double rate_hz = icm42688p_rate(wanted_hz);
    double delay_s = icm42688p_alias_s;
    if (rate_hz >= 2000)
        delay_s += icm42688p_periods_when_fast / rate_hz;
    else if (filter == 0)
        delay_s += icm42688p_periods_of_code_0 / std::max(25.0, rate_hz);
    else
        delay_s += icm42688p_ms_at_400_hz.at(std::min(filter, 7U)) * 0.4 / std::max(400.0, rate_hz);
    return {from_s(delay_s), icm42688p_rest, FilterDelaySource::model};
}

FilterDelay unknown(double bandwidth_hz) {
    return {{}, from_s(periods_of_bandwidth / bandwidth_hz), FilterDelaySource::unknown};
}

/// Without the age of what the board reads.
FilterDelay of_filters(const ImuModel& model, unsigned filter, double rate_hz) {
    if (is_adis(model)) return adis_delay(model, filter, rate_hz);
    if (model.kind == wire::ImuKind::icm42688p) return icm42688p_delay(filter, rate_hz);
    if (model.kind == wire::ImuKind::bmi088) return unknown(bmi088_bandwidth_hz(rate_hz));
    return {{}, vn100_window, FilterDelaySource::unknown};
}

/// What the board reads on its own grid is as old as anything up to this, a period of the part. A
/// VN-100 sends by itself.
double oldest_s(const ImuModel& model, double rate_hz, bool data_ready) {
    if (data_ready || model.kind == wire::ImuKind::vn100) return 0;
    const double rate = part_rate(rate_hz, data_ready);
    return is_adis(model) ? adis_averaged(model, rate) / model.fastest_hz : 1 / rate;
}

/// Standard deviation of an age that is as likely to be new as `oldest_s`.
double age_sigma_s(double oldest_s) { return oldest_s / std::sqrt(12); }

}  // namespace

const char* to_string(FilterDelaySource source) {
    switch (source) {
        case FilterDelaySource::unknown: return "unknown";
        case FilterDelaySource::model: return "model";
        case FilterDelaySource::configuration: return "configuration";
    }
    return "unknown";
}

FilterDelay filter_delay(const ImuModel& model, unsigned filter, double rate_hz, bool data_ready) {
    FilterDelay delay = of_filters(model, filter, part_rate(rate_hz, data_ready));
    const double oldest = oldest_s(model, rate_hz, data_ready);
    delay.delay = delay.delay + from_s(oldest / 2);
    delay.sigma =
        from_s(std::hypot(static_cast<double>(delay.sigma.ns) * 1e-9, age_sigma_s(oldest)));
    return delay;
}

FilterDelay measured_delay(const ImuModel& model, double rate_hz, bool data_ready,
                           Duration measured) {
    return {measured, from_s(age_sigma_s(oldest_s(model, rate_hz, data_ready))),
            FilterDelaySource::configuration};
}

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
    if ((sample.flags & wire::imu_repeated) != 0) metadata.flags |= flag_repeated;
    if ((sample.flags & wire::imu_accel_stamped) != 0) {
        metadata.flags |= flag_accel_age;
        metadata.accel_age_ns = sample.accel_age * wire::accel_age_unit_ns;
    }
    return metadata;
}

}  // namespace versavis::imu
