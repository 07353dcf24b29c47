// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_count.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace versavis::client {

namespace {

/// Readings that differ by more than this many steps are different counts. If lower, the two ends
/// of a step that is not split rival each other; if higher, neighbours do not.
constexpr double other_count = 0.75;
/// Levels are not better known than this: one LED is brighter than another, light is reflected. If
/// lower, confidence is claimed that no real board bears out; if higher, readings in a bright room
/// count as ambiguous.
constexpr double level_sigma = 0.05;
/// Below this confidence a reading is ambiguous: of the least clear ones, one in a hundred may be
/// wrong.
constexpr double least_confidence = 0.99;
/// Levels that differ more from those of any board are of something else. If lower, a board in a
/// bright room is doubted; if higher, a scene passes for one.
constexpr double largest_residual = 0.2;

double squared(const LedLevels& a, const LedLevels& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += (a.at(i) - b.at(i)) * (a.at(i) - b.at(i));
    return sum;
}

/// A picture shows no step when one explains it no better than this, as a sum of squares; less
/// where exposures are hardly shorter than a step. If lower, noise passes for a step at the edge of
/// the exposure; if higher, steps near it are not used.
constexpr double no_step = 4 * level_sigma * level_sigma;

struct Fit {
    double phase = 0;
    double half_width = 0;
    double cost = std::numeric_limits<double>::infinity();  ///< sum of squares
};

/// Levels change linearly with the start, as long as neither end of the exposure passes a step.
Fit fit_piece(const LedLevels& levels, double from, double to, double exposure,
              const LedLayout& layout) {
    const LedLevels first = led_levels(from, exposure, layout);
    const LedLevels last = led_levels(to, exposure, layout);
    const double length = squared(first, last);
    const double middle = exposure / 2;
    if (length < 1e-12) {
        // From the beginning of the piece to its end nothing changes.
        return {(from + to) / 2 + middle, (to - from) / 2, squared(levels, first)};
    }
    double along = 0;
    for (std::size_t i = 0; i < levels.size(); ++i)
        along += (levels.at(i) - first.at(i)) * (last.at(i) - first.at(i));
    const double share = std::clamp(along / length, 0.0, 1.0);
    LedLevels fitted{};
    for (std::size_t i = 0; i < levels.size(); ++i)
        fitted.at(i) = first.at(i) + share * (last.at(i) - first.at(i));
    return {from + share * (to - from) + middle, 0, squared(levels, fitted)};
}

}  // namespace

double wrapped_steps(double steps, double period) {
    return steps - period * std::floor(steps / period + 0.5);
}

LedLevels led_levels(double start, double exposure, const LedLayout& layout) {
    LedLevels levels{};
    const auto add = [&](std::int64_t count, double share) {
        const auto wrapped =
            static_cast<std::size_t>((count % led_period + led_period) % led_period);
        const std::size_t place = wrapped % 4;
        const auto at = [&](std::size_t led) -> double& {
            return levels.at(layout.binary_first ? 7 - led : led);
        };
        at(layout.backward ? 3 - place : place) += share;
        for (std::size_t bit = 0; bit < 4; ++bit)
            if ((wrapped / 4 >> bit & 1U) != 0)
                at(layout.high_bit_first ? 7 - bit : 4 + bit) += share;
    };
    const double end = start + exposure;
    for (double from = start; from < end;) {
        const double next = std::min(end, std::floor(from) + 1);
        add(static_cast<std::int64_t>(std::floor(from)), (next - from) / exposure);
        from = next;
    }
    return levels;
}

LedReading read_leds(const LedLevels& levels, double exposure, const LedLayout& layout) {
    std::array<Fit, led_period * 2> fits;
    // Where the end of the exposure passes a step while its start does not.
    const double turn = std::ceil(exposure) - exposure;
    const bool turns = turn > 1e-9 && turn < 1 - 1e-9;
    for (int count = 0; count < led_period; ++count) {
        const auto i = static_cast<std::size_t>(count) * 2;
        fits.at(i) = fit_piece(levels, count, count + (turns ? turn : 1), exposure, layout);
        if (turns) fits.at(i + 1) = fit_piece(levels, count + turn, count + 1, exposure, layout);
    }
    const auto worth = [](const Fit& fit) {
        return fit.cost - no_step * std::min(1.0, 4 * fit.half_width);
    };
    const Fit best = *std::min_element(
        fits.begin(), fits.end(), [&](const Fit& a, const Fit& b) { return worth(a) < worth(b); });
    double rival = std::numeric_limits<double>::infinity();
    double opposite = rival;  // half a period away
    for (const Fit& fit : fits) {
        const double away = std::abs(wrapped_steps(fit.phase - best.phase));
        if (away > led_period / 2.0 - other_count)
            opposite = std::min(opposite, fit.cost);
        else if (away > other_count)
            rival = std::min(rival, fit.cost);
    }
    LedReading reading;
    reading.phase = best.phase - led_period * std::floor(best.phase / led_period);
    reading.half_width = best.half_width;
    reading.residual = std::sqrt(best.cost / static_cast<double>(levels.size()));
    const double sigma = std::max(level_sigma, reading.residual);
    const auto confidence = [&](double cost) {
        return 1 / (1 + std::exp(-(cost - best.cost) / (2 * sigma * sigma)));
    };
    reading.confidence = confidence(rival);
    if (confidence(opposite) < least_confidence) reading.period = led_period / 2.0;
    reading.ambiguous =
        reading.confidence < least_confidence || reading.residual > largest_residual;
    return reading;
}

}  // namespace versavis::client
