// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/relation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace versavis::pairing {

namespace {

constexpr double drift_gain_per_s = 0.2;
constexpr double largest_drift_gain = 0.05;
constexpr double largest_drift = 500e-6;
constexpr double difference_gain = 0.25;
constexpr double earlier_gain = 0.125;
constexpr double later_gain = 0.0625;
constexpr double outlier_ns = 2e6;
constexpr double outlier_deviations = 2;
constexpr std::int64_t deviation_memory = 16;
constexpr std::int64_t tolerance_floor_ns = 30'000;
constexpr std::int64_t deviations_tolerated = 5;
constexpr std::int64_t time_until_drift_is_known_ns = 10'000'000'000;
constexpr double drift_unknown = 250e-6;
constexpr double drift_known = 20e-6;

}  // namespace

void Relation::begin(std::int64_t frame_ns, std::int64_t instant_ns) {
    drift_ = 0;
    deviation_ns_ = 0;
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
