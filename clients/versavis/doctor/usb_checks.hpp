// SPDX-License-Identifier: BSD-3-Clause
// The board and USB3 Vision cameras on the bus: speed, power saving, permissions, memory for
// transfers.
#pragma once

#include "doctor/finding.hpp"
#include "doctor/subject.hpp"

namespace versavis::client {

Findings check_usb(const Subject& subject);

}  // namespace versavis::client
