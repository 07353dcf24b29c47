// SPDX-License-Identifier: BSD-3-Clause
// Raw IMU words to SI units, as the part's data sheet has it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "versavis/metadata.hpp"
#include "wire/messages.hpp"

namespace versavis::imu {

/// Scale factors of one part; a linear reading is `raw * scale + offset`.
struct ImuModel {
    wire::ImuKind kind = wire::ImuKind::none;
    const char* name = "none";
    double gyro_rad_s = 0;     ///< per LSB
    double accel_m_s2 = 0;     ///< per LSB
    double magnetic_t = 0;     ///< per LSB; 0: no magnetometer
    double pressure_pa = 0;    ///< per LSB; 0: no barometer
    double temperature_c = 0;  ///< per LSB
    double temperature_at_zero_c = 0;
};

/// Names of all models, as the configuration has them.
std::vector<std::string> model_names();

/// The model of a part, by its kind on the wire or its name in the configuration; null when there
/// is none.
const ImuModel* find_model(wire::ImuKind kind);
const ImuModel* find_model(const std::string& name);

/// Fills the physical quantities of `sample`; times, number and epoch are the caller's.
ImuMetadata to_si(const ImuModel& model, const wire::ImuSample& sample);

}  // namespace versavis::imu
