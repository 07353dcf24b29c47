// SPDX-License-Identifier: BSD-3-Clause
// Whether a GenICam description can be believed: it is whole, of bounded size, and no value in it
// leads back to itself. Runs in a process of its own, because parsing it may already end that.
#pragma once

#include "camera/description.hpp"

namespace versavis::daemon {

/// Errors say what is wrong with the description.
Expected<> check_description(const Description& description);

/// The probe process: bounds its own memory and time, checks what it reads from standard input, and
/// prints why it is refused. Returns the exit code, zero for a good one.
int run_description_probe(bool zipped);

}  // namespace versavis::daemon
