// SPDX-License-Identifier: BSD-3-Clause
// Holds a configuration from the host against what the board can do.
#pragma once

#include "versavis/wire/messages.hpp"

namespace versavis::firmware {

/// Fills status, refused field and its range; `taken` is the caller's.
void check(const wire::Configuration& configuration, wire::ConfigurationAnswer& answer);

}  // namespace versavis::firmware
