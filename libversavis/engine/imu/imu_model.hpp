// SPDX-License-Identifier: BSD-3-Clause
// Raw IMU words to SI units, and the delay of the part's filters, as its data sheet has it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "versavis/metadata.hpp"
#include "wire/messages.hpp"

namespace versavis::imu {

/// One part, as the configuration names it, and what its raw words are worth.
struct ImuModel {
    const char* name = "none";
    wire::ImuKind kind = wire::ImuKind::none;
    double fastest_hz = 0;          ///< with the data-ready line
    unsigned strongest_filter = 0;  ///< as the configuration numbers them, from 0
    double fastest_i2c_hz = 0;      ///< 0: it cannot be on I2C
    bool accel_ready = false;       ///< its accelerometer has a data-ready line of its own
    double element_hz = 0;          ///< -3 dB bandwidth of its gyro element; 0: in other filters
};

/// Names of all models, as the configuration has them.
std::vector<std::string> model_names();

/// The model of a part, by its kind on the wire or its name in the configuration; null when there
/// is none.
const ImuModel* find_model(wire::ImuKind kind);
const ImuModel* find_model(const std::string& name);

enum class FilterDelaySource { unknown, model, configuration };
const char* to_string(FilterDelaySource source);

/// How much later than the motion its sample is: by the part's element, by the filters that it is
/// set up with, and, without its data-ready line, by the age of what the board reads. Of the
/// angular rate; the acceleration may be some tenths of a millisecond earlier.
struct FilterDelay {
    Duration delay;
    Duration sigma;  ///< one standard deviation
    FilterDelaySource source = FilterDelaySource::unknown;
};

/// Of a part set up for this strength and rate.
FilterDelay filter_delay(const ImuModel& model, unsigned filter, double rate_hz, bool data_ready);

/// The same where the mean has been measured: what is left is the spread of the age.
FilterDelay measured_delay(const ImuModel& model, double rate_hz, bool data_ready,
                           Duration measured);

/// Fills the physical quantities of `sample` and the age of its acceleration; times, number and
/// epoch are the caller's.
ImuMetadata to_si(const ImuModel& model, const wire::ImuSample& sample);

}  // namespace versavis::imu
