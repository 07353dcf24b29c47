// SPDX-License-Identifier: BSD-3-Clause
#include "crystal.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::clock_world {

namespace {

constexpr double step_s = 0.05;
constexpr double ramp_s = 600;

}  // namespace

Crystal::Crystal(const CrystalSettings& settings, Duration length, std::mt19937_64& random) {
    std::uniform_real_distribution<> either(-1, 1);
    std::normal_distribution<> walk(0, settings.walk_ppm * 1e3 * std::sqrt(step_s));
    const double ramp = (either(random) < 0 ? -1e3 : 1e3) * settings.ramp_ppm;
    const double begin_s = static_cast<double>(settings.ramp_begin.ns) * 1e-9;
    double wandered = either(random) * settings.largest_skew_ppm * 1e3;
    double gained = 0;
    const auto steps = static_cast<std::size_t>(static_cast<double>(length.ns) * 1e-9 / step_s) + 2;
    for (std::size_t i = 0; i < steps; ++i) {
        const double t = static_cast<double>(i) * step_s;
        const double skew = wandered + ramp * std::clamp((t - begin_s) / ramp_s, 0.0, 1.0);
        if (i > 0) gained += (skew_.back() + skew) / 2 * step_s;
        skew_.push_back(skew);
        gained_ns_.push_back(gained);
        wandered += walk(random);
    }
}

Duration Crystal::gained(TrueTime at) const {
    const double steps = static_cast<double>(at.ns) * 1e-9 / step_s;
    const auto i = static_cast<std::size_t>(
        std::clamp(std::floor(steps), 0.0, static_cast<double>(skew_.size() - 2)));
    const double part = steps - static_cast<double>(i);
    const double slope = skew_[i + 1] - skew_[i];
    return {std::llround(gained_ns_[i] + step_s * part * (skew_[i] + slope * part / 2))};
}

}  // namespace versavis::clock_world
