// SPDX-License-Identifier: BSD-3-Clause
// A board's clock against true time: a crystal that is off, wanders and warms up.
#pragma once

#include <random>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::clock_world {

using TrueTime = Time<struct TrueClockTag>;  ///< since the beginning of the simulation

struct CrystalSettings {
    double largest_skew_ppm = 30;
    double walk_ppm = 0.01;  ///< per sqrt(s)
    double ramp_ppm = 2;     ///< up or down, in ten minutes
    Duration ramp_begin = seconds(200);
};

class Crystal {
 public:
    Crystal(const CrystalSettings& settings, Duration length, std::mt19937_64& random);

    /// What its clock has gained since the beginning.
    Duration gained(TrueTime at) const;

 private:
    std::vector<double> gained_ns_;  ///< at each step
    std::vector<double> skew_;       ///< ns/s
};

}  // namespace versavis::clock_world
