// SPDX-License-Identifier: BSD-3-Clause
// Whether the frames of a camera are of the exposures that they say they are of.
#pragma once

#include "verify/clock_witness.hpp"
#include "verify/recorded_evidence.hpp"
#include "verify/stream_order.hpp"
#include "verify/verdict.hpp"

namespace versavis::client {

/// By the board's records, the camera's clock and block ids, and the arrivals. The pairing is not
/// repeated: each frame's claim is held against all that was recorded before and after it.
StreamVerdict judge_camera(const CameraEvidence& camera, const ClockWitness& clock,
                           StreamOrder order);

}  // namespace versavis::client
