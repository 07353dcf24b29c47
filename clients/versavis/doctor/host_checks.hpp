// SPDX-License-Identifier: BSD-3-Clause
// The computer itself: real time, governor, space, permissions.
#pragma once

#include "doctor/finding.hpp"
#include "doctor/subject.hpp"

namespace versavis::client {

Findings check_host(const Subject& subject);

}  // namespace versavis::client
