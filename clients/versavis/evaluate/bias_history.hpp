// SPDX-License-Identifier: BSD-3-Clause
// What a bias does beside its noise: it settles after power-on, drifts, or follows a temperature.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace versavis::client {

/// bias(t) = slope * t + settling * exp(-t / time_constant), t from the beginning; units as those
/// of the rates, per second.
struct BiasDrift {
    double slope = 0;
    double settling = 0;
    double time_constant_s = 0;  ///< 0: it does not settle

    double at(double t_s) const;
};

struct BiasHistory {
    std::optional<BiasDrift> drift;  ///< none: a random walk and flicker explain as much
    /// What is left changes more smoothly than such noises do.
    bool smooth = false;
    /// The random walk is below this, at two standard deviations, whatever a drift took of it; rate
    /// / s / sqrt(Hz).
    double walk_limit = 0;
};

/// By the likelihood of the means of up to 128 blocks under white noise of `density` (rate /
/// sqrt(Hz)), flicker noise and a random walk of the bias, of any size, with and without a drift;
/// and by the portmanteau test of what is left (G. Box, D. Pierce, JASA 65, 1970). `white_from_s`:
/// the averaging time from which on the noise is white; too short recordings have no history.
BiasHistory bias_history(std::span<const float> rates, double interval_s, double density,
                         double white_from_s);

}  // namespace versavis::client
