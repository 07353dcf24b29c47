// SPDX-License-Identifier: BSD-3-Clause
// Samples of any IMU as an ADIS16448 would give them, for a flight controller on the second SPI
// port.
#pragma once

#include "base/hal.hpp"
#include "wire/messages.hpp"

namespace versavis::firmware {

/// False: the sample failed its check, and must not be shown.
bool adis16448_image(const wire::ImuSample& sample, ImuImage& image);

}  // namespace versavis::firmware
