// SPDX-License-Identifier: BSD-3-Clause
// What an IMU feels at an instant, and the interface of every model of one.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>

#include "base/hal.hpp"

namespace versavis::devices {

using firmware::Nanoseconds;

struct Inertial {
    std::array<double, 3> gyro_deg_s{};
    std::array<double, 3> accel_g{};
    std::array<double, 3> magnetic_gauss{};
    double temperature_c = 25;
    double pressure_mbar = 1013.25;
};

/// True motion and environment at an instant.
using World = std::function<Inertial(Nanoseconds at)>;

/// Instants at which a sensor takes new data: `period_ns` apart, counted from `origin`, without
/// drift.
struct UpdateTimes {
    Nanoseconds origin = 0;
    double period_ns = 1e9;

    std::int64_t index_at(Nanoseconds at) const;
    Nanoseconds time(std::int64_t index) const;
    bool operator==(const UpdateTimes&) const = default;
};

/// How much later than the motion samples are.
struct SampleDelays {
    Nanoseconds gyro = 0;
    Nanoseconds accel = 0;
};

/// A part on the SPI bus, at register level.
class SpiImuDevice {
 public:
    virtual ~SpiImuDevice() = default;

    /// One selection of chip `transfer.chip`, begun at `at`.
    virtual void transfer(Nanoseconds at, const firmware::ImuTransfer& transfer,
                          std::span<std::uint8_t> received) = 0;

    /// The same on I2C. False: nobody acknowledged.
    virtual bool i2c(Nanoseconds /*at*/, const firmware::ImuTransfer& /*transfer*/,
                     std::span<std::uint8_t> /*received*/) {
        return false;
    }

    /// When new data is taken with the present settings; a data-ready edge rises at each instant.
    virtual UpdateTimes updates() const = 0;
    /// False: the data-ready line does not pulse with the present settings.
    virtual bool signals(Nanoseconds at) const = 0;
    /// By the element and the filters as they are set up.
    virtual SampleDelays delays() const { return {}; }

    /// The same of an accelerometer with a clock and a line of its own.
    virtual UpdateTimes accel_updates() const { return {}; }
    virtual bool accel_signals(Nanoseconds /*at*/) const { return false; }
    /// The newest values that the accelerometer showed: when they were read, and when taken.
    virtual std::span<const std::pair<Nanoseconds, Nanoseconds>> accel_reads() const { return {}; }

    /// The part loses its settings, as after a brown-out.
    virtual void brown_out(Nanoseconds at) = 0;

    /// Breaches of the data sheet's rules: clock, gaps, accesses at the wrong time.
    unsigned breaches() const { return breaches_; }

 protected:
    unsigned breaches_ = 0;
};

/// Rounded and saturated to 16 bits.
std::int16_t counts(double value, double lsb);

}  // namespace versavis::devices
