// SPDX-License-Identifier: BSD-3-Clause
// The set-up of an IMU as text, to hold against its data sheet.
#pragma once

#include <fmt/format.h>

#include <string>
#include <vector>

#include "imu/imu_part.hpp"

namespace versavis::firmware {

/// "chip:register=value, pause in us", or with ? instead of =: what it must answer. In hexadecimal
/// but the pause.
inline std::vector<std::string> setup_of(wire::ImuKind kind, const PartSettings& settings) {
    Setup setup;
    find_part(kind)->setup(settings, setup);
    std::vector<std::string> steps;
    for (std::size_t i = 0; i < setup.size(); ++i) {
        const SetupStep& step = setup[i];
        steps.push_back(fmt::format("{}:{:02X}{}{:X}, {}", step.chip, step.address,
                                    step.action == SetupStep::Action::write ? '=' : '?', step.value,
                                    step.pause_us));
    }
    return steps;
}

/// What one of the steps at this register puts on the bus.
inline ImuTransfer access_of(wire::ImuKind kind, const SetupStep& step) {
    ImuTransfer transfer;
    find_part(kind)->access(step, transfer);
    return transfer;
}

}  // namespace versavis::firmware
