// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace versavis::client {

namespace {

/// Reading and correcting take turns.
constexpr int calibration_turns = 3;

/// Pictures that are read, at least: fewer say more of their noise than of the LEDs.
constexpr std::size_t least_readings = 20;

/// Shares of the pictures that show an LED off and on for sure, to begin with.
constexpr double surely_off = 0.05;
constexpr double surely_on = 0.95;

/// Levels of an LED that was off and on differ by this, at least.
constexpr double least_swing = 0.3;

/// An LED as it is seen: level = off + gain * share of the exposure that it was on.
struct SeenLed {
    double off = 0;
    double gain = 1;
};
using SeenLeds = std::array<SeenLed, 8>;

double steps_of(const LedObservation& shot, double rate_hz) {
    return static_cast<double>(shot.exposure.ns) * 1e-9 * rate_hz;
}

bool well_seen(const LedObservation& shot, double steps) {
    return shot.picture.state == LedState::good && steps > 0 && steps <= most_led_steps;
}

void even_out(std::vector<LedObservation>& shots, const SeenLeds& leds) {
    for (LedObservation& shot : shots)
        for (std::size_t i = 0; i < leds.size(); ++i) {
            double& level = shot.picture.levels.at(i);
            level = (level - leds.at(i).off) / leds.at(i).gain;
        }
}

/// Without any reading: what pictures show at least, and at most.
SeenLeds by_extremes(const std::vector<LedObservation>& shots, double rate_hz) {
    SeenLeds leds;
    for (std::size_t i = 0; i < leds.size(); ++i) {
        std::vector<double> levels;
        for (const LedObservation& shot : shots)
            if (well_seen(shot, steps_of(shot, rate_hz)))
                levels.push_back(shot.picture.levels.at(i));
        if (levels.size() < least_readings) continue;
        std::sort(levels.begin(), levels.end());
        const auto at = [&](double share) {
            return levels[static_cast<std::size_t>(share * static_cast<double>(levels.size() - 1))];
        };
        const double swing = at(surely_on) - at(surely_off);
        if (swing > least_swing) leds.at(i) = {at(surely_off), swing};
    }
    return leds;
}

struct LevelSums {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    double least = 1, most = 0;

    void add(double share, double level) {
        ++n;
        x += share;
        y += level;
        xx += share * share;
        xy += share * level;
        least = std::min(least, share);
        most = std::max(most, share);
    }
    SeenLed line() const {
        const double spread = xx - x * x / n;
        if (n < static_cast<double>(least_readings) || most - least < 0.5 || spread <= 0) return {};
        const double gain = (xy - x * y / n) / spread;
        if (gain < least_swing) return {};
        return {(y - gain * x) / n, gain};
    }
};

struct CalibrationTurn {
    SeenLeds leds;
    std::size_t pictures = 0;
    std::size_t read = 0;
};

/// A line through what each LED shows over what the readings say that it was on.
CalibrationTurn by_readings(const std::vector<LedObservation>& shots, double rate_hz,
                            const LedLayout& layout) {
    CalibrationTurn result;
    std::array<LevelSums, 8> sums;
    for (const LedObservation& shot : shots) {
        const double steps = steps_of(shot, rate_hz);
        if (!well_seen(shot, steps)) continue;
        ++result.pictures;
        const LedReading reading = read_leds(shot.picture.levels, steps, layout);
        if (reading.ambiguous || reading.half_width > 0) continue;
        ++result.read;
        const LedLevels on = led_levels(reading.phase - steps / 2, steps, layout);
        for (std::size_t i = 0; i < on.size(); ++i)
            sums.at(i).add(on.at(i), shot.picture.levels.at(i));
    }
    for (std::size_t i = 0; i < sums.size(); ++i) result.leds.at(i) = sums.at(i).line();
    return result;
}

}  // namespace

std::vector<LedObservation> calibrated_leds(std::vector<LedObservation> shots, double rate_hz,
                                            const LedLayout& layout) {
    for (int turn = 0; turn < calibration_turns; ++turn) {
        const CalibrationTurn found = by_readings(shots, rate_hz, layout);
        const bool unreadable = turn == 0 && 2 * found.read < found.pictures;
        even_out(shots, unreadable ? by_extremes(shots, rate_hz) : found.leds);
    }
    return shots;
}

}  // namespace versavis::client
