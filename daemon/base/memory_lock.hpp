// SPDX-License-Identifier: BSD-3-Clause
// Keeps all memory of this process in RAM, so that nothing that stamps or publishes waits for swap.
#pragma once

#include "versavis/error.hpp"

namespace versavis::daemon {

/// What is mapped now, and all that will be. Errors: the limit on locked memory is too low; the
/// message names it.
Expected<> lock_memory();

}  // namespace versavis::daemon
