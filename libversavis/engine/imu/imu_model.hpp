// SPDX-License-Identifier: BSD-3-Clause
// Raw IMU words to SI units, as the part's data sheet has it.
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
