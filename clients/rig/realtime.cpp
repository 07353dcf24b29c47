// SPDX-License-Identifier: BSD-3-Clause
#include "realtime.hpp"

#include <pthread.h>

namespace versavis::rig {

namespace {

/// Below the threads of the service that ask for real time (20): it is their delays that are
/// measured.
constexpr int hardware_priority = 10;

}  // namespace

void run_like_hardware() {
    const sched_param wanted{hardware_priority};
    ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &wanted);
}

}  // namespace versavis::rig
