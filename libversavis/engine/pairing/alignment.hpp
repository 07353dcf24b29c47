// SPDX-License-Identifier: BSD-3-Clause
// Finds which exposures a sequence of frames belongs to when nothing is known of camera clock and
// numbers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/pairing/exposure_log.hpp"

namespace versavis::pairing {

// How far the board's time on the host may be off before the clock is settled. At half frames of
// very quick cameras may seem to arrive too early; at twice frames before the pulse pass more
// often.
inline constexpr Duration translation_error = milliseconds(5);

// A frame that comes later than this after its exposure counts as lost. At half busy networks lose
// frames; at twice slow triggers, a second apart, prove nothing, and a lost frame is known later.
inline constexpr Duration usual_latest_arrival = milliseconds(500);

// A frame whose exposure's record has not come for so long is given up. At half a stalled USB link
// costs more frames; at twice each frame without record holds up those behind it for longer.
inline constexpr Duration usual_exposure_wait = milliseconds(250);

struct Limits {
    Duration period = milliseconds(50);              ///< of the triggers, when none is left out
    Duration earliest_arrival = -translation_error;  ///< after the end of exposure
    Duration latest_arrival = usual_latest_arrival;  ///< after the end of exposure
    Duration exposure_wait = usual_exposure_wait;    ///< of a frame for its exposure's record
    Duration pattern_duration = seconds(1);          ///< how long the board's start pattern takes
    std::uint32_t frames_held = 8;                   ///< most frames that wait for proof
    bool camera_clock = true;            ///< false: pair by arrival, whatever the frames say
    Instant stamped = Instant::unknown;  ///< by the camera; unknown: it is found out
};

// An alignment that takes so many faults is ruled out. At half (1) one fault that nobody saw can
// leave a wrong alignment as the only one; at twice (4) more starts stay undecided.
inline constexpr unsigned faults_to_refute = 2;

// The same where no exposure line shows which triggers the camera took. At half a camera that
// ignores one trigger in five gets wrong pairs; at twice starts amid other triggers take longer.
inline constexpr unsigned unseen_faults_to_refute = 4;

// Faults of a step of the ids that no ignored trigger explains: more than rule out any alignment.
inline constexpr unsigned impossible_step = 100;

bool arrival_possible(const Limits& limits, const Arrival& arrival, const Exposure& exposure);

/// Triggers after `from`, down to `to`, that the camera may not have taken: their exposure line
/// stayed silent, or their record is missing.
std::uint64_t perhaps_not_taken(const Record& from, const Record& to);

/// How many faults it takes that block ids step by `id_step` between these triggers. Cameras count
/// either every trigger or only those that they took: both counts are right. A trigger without
/// record may have been taken or not.
unsigned step_faults(std::uint64_t id_step, const Record& from, const Record& to);

/// True when these cannot be lengths of the same exposure, as reported by the camera and as
/// measured.
bool lengths_differ(Duration reported, Duration measured);

/// True when the camera's own account of the exposure cannot be of this one.
bool length_contradicts(const Arrival& arrival, const Exposure& exposure);

/// The triggers of the frames, one each, if there is proof, else nothing: one alignment of the two
/// sequences takes no fault to explain it, and each other one at least two, whichever of `instants`
/// the frames' times are of: what the camera may stamp, or the arrival alone. By the camera's clock
/// the triggers must be irregular within them; by arrival alone they must be further apart than a
/// frame may be late. A zero stands for a frame that is not proved with the others, because it came
/// late.
std::vector<std::uint64_t> align(const std::vector<Arrival>& frames, const ExposureLog& exposures,
                                 std::span<const Instant> instants, const Limits& limits);

/// Least number of frames that can prove anything by the camera's clock, or by arrival alone.
std::size_t frames_for_proof(bool by_clock);

}  // namespace versavis::pairing
