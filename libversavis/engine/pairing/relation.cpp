// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/relation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace versavis::pairing {

namespace {

// Share of a surprise that counts as drift, per second between frames. At half the rate of a
// camera's clock takes twice as long to learn; at twice its jitter enters the rate.
constexpr double drift_gain_per_s = 0.2;

// Most of that share, however far apart frames are. At half slow cameras learn the rate in twice
// as many frames; at twice one odd stamp bends the rate for several frames.
constexpr double largest_drift_gain = 0.05;

// Fastest rate believed, far beyond any crystal. At half (250 ppm) bad oscillators are still
// followed; at twice one wild stamp may bend the rate further.
constexpr double largest_drift = 500e-6;

// Share of a surprise that counts as difference of the clocks. At half a change of rate is followed
// later; at twice half of the stamps' jitter is followed.
constexpr double difference_gain = 0.25;

// The same for frames that come earlier than usual. At half the usual lateness stays too high after
// a slow start; at twice it sinks to the earliest frames, and ordinary ones look irregular.
constexpr double earlier_gain = 0.125;

// The same for frames that come later than usual: less, for a busy host delays single frames. At
// half the usual lateness sinks to the earliest frames; at twice single late ones count more.
constexpr double later_gain = 0.0625;

// A lateness beyond this, plus some deviations, is cut: it says little of the frames to come. At
// half a growing delay is followed later; at twice a host that hangs for a moment counts more.
constexpr double outlier_ns = 2e6;

// The deviations on top. At half lasting jitter is learned later, at twice rare hangs count more.
constexpr double outlier_deviations = 2;

// Frames over which the mean deviation is taken. At half it wanders, and arrivals near the limit
// say nothing at times; at twice it remembers jitter for long after it has ended.
constexpr std::int64_t deviation_memory = 16;

// Least distance that a camera's stamp may be off: jitter of stamp and trigger. At half cameras
// with coarse clocks depend on the learned deviation alone; at twice small steps may be missed.
constexpr std::int64_t tolerance_floor_ns = 30'000;

// Mean deviations that a stamp may be off. At half ordinary jitter looks like a step of the clock;
// at twice a step that falls close to another exposure is taken for jitter.
constexpr std::int64_t deviations_tolerated = 5;

// Time after which the rate counts as learned. At half it may still be off when it is trusted; at
// twice gaps between frames widen the tolerance for longer.
constexpr std::int64_t time_until_drift_is_known_ns = 10'000'000'000;

// How fast the tolerance grows without frames until then: two crystals of 100 ppm, and some. At
// half bad crystals seem to step in a gap of seconds; at twice a step within such a gap may be
// missed.
constexpr double drift_unknown = 250e-6;

// The same afterwards: what a warming crystal changes. At half a change of temperature looks like
// a step; at twice a step after a long gap may be missed.
constexpr double drift_known = 20e-6;

}  // namespace

void Relation::begin(std::int64_t frame_ns, std::int64_t instant_ns) {
    known_ = true;
    begun_ns_ = instant_ns;
    move(frame_ns, instant_ns);
}

void Relation::move(std::int64_t frame_ns, std::int64_t instant_ns) {
    difference_ns_ = frame_ns - instant_ns;
    at_ns_ = instant_ns;
}

std::int64_t Relation::expected_instant_ns(std::int64_t frame_ns) const {
    const std::int64_t undrifted = frame_ns - difference_ns_;
    return undrifted - std::llround(drift_ * static_cast<double>(undrifted - at_ns_));
}

std::int64_t Relation::tolerance_ns(std::int64_t instant_ns) const {
    const bool settled = at_ns_ - begun_ns_ > time_until_drift_is_known_ns;
    const double rate = !drifts_ ? 0 : settled ? drift_known : drift_unknown;
    return tolerance_floor_ns + deviations_tolerated * deviation_ns_ +
           std::llround(rate * static_cast<double>(std::abs(instant_ns - at_ns_)));
}

void Relation::track(std::int64_t frame_ns, std::int64_t instant_ns) {
    if (!known()) return begin(frame_ns, instant_ns);
    const auto elapsed = static_cast<double>(instant_ns - at_ns_);
    const double drifted = drift_ * elapsed;
    double surprise = static_cast<double>(frame_ns - instant_ns - difference_ns_) - drifted;
    double gain = difference_gain;
    if (!drifts_) {  // a frame that the host was slow to take says little of the others
        surprise = std::min(surprise,
                            outlier_ns + outlier_deviations * static_cast<double>(deviation_ns_));
        gain = surprise < 0 ? earlier_gain : later_gain;
    }
    if (drifts_ && elapsed > 0) {
        const double drift_gain = std::min(drift_gain_per_s * elapsed * 1e-9, largest_drift_gain);
        drift_ =
            std::clamp(drift_ + drift_gain * surprise / elapsed, -largest_drift, largest_drift);
    }
    deviation_ns_ += (std::llround(std::abs(surprise)) - deviation_ns_) / deviation_memory;
    difference_ns_ += std::llround(drifted + gain * surprise);
    at_ns_ = instant_ns;
}

}  // namespace versavis::pairing
