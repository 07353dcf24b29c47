// SPDX-License-Identifier: BSD-3-Clause
// Processor time of the service, and of Aravis's own test program on the same camera.
#pragma once

#include <sys/types.h>

#include "../support/stack.hpp"

namespace versavis::bench {

inline constexpr double frame_gb = 1920.0 * 1200.0 * 1e-9;

/// User and system time of a running process, all threads.
double cpu_seconds(pid_t pid);

/// Of `arv-camera-test` on the first camera of the rig, by sockets with packets of 9000 bytes.
/// Throws when it received nothing.
double aravis_cpu_per_gb(test::Stack& stack, double seconds);

}  // namespace versavis::bench
