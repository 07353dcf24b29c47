// SPDX-License-Identifier: BSD-3-Clause
// Lets what stands in for hardware keep its times on a machine that is busy.
#pragma once

namespace versavis::rig {

/// The calling thread, and those that it starts from here on, run ahead of all ordinary ones: a
/// device does not wait until the host has time for it. Where this is not allowed, they run as
/// before.
void run_like_hardware();

}  // namespace versavis::rig
