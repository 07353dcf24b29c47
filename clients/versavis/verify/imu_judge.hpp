// SPDX-License-Identifier: BSD-3-Clause
// Whether the samples of an IMU are from when they say.
#pragma once

#include "verify/clock_witness.hpp"
#include "verify/recorded_evidence.hpp"
#include "verify/stream_order.hpp"
#include "verify/verdict.hpp"

namespace versavis::client {

/// By their numbers, the samples beside them, and the messages that brought them.
StreamVerdict judge_imu(const ImuEvidence& imu, const std::vector<BoardTime>& set_up,
                        const ClockWitness& clock, StreamOrder order);

}  // namespace versavis::client
