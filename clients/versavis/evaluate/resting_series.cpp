// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/resting_series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/median.hpp"

namespace versavis::client {

namespace {

// A second in which the gyro scatters this many times more than usually is motion. If lower, bursts
// of noise are taken for it; if higher, gentle touches pass.
constexpr double motion_factor = 6;

// Share of samples that may be missing, and are filled in: as much of the noise is seen twice.
constexpr double most_missing = 0.02;

// A value this many sigmas off those beside it is a spike: of honest values none in 10^13.
constexpr double spike_sigmas = 8;

// Values to each side that a spike is compared with: two in a row may be off.
constexpr std::size_t spike_reach = 3;

// Share of values that may be spikes. If higher, the cable matters, and not the part's noise.
constexpr double most_spikes = 0.001;

// A shorter recording does not show white noise and motion.
constexpr double least_duration_s = 10;

constexpr std::size_t least_samples = 100;

// Of a normal distribution: sigma against the median of amounts.
constexpr double sigma_of_median = 1.4826;

/// The usual time between samples: lost ones do not change it.
double usual_interval_ns(const std::vector<OutputTime>& times) {
    std::vector<double> gaps;
    gaps.reserve(times.size());
    for (std::size_t i = 1; i < times.size(); ++i)
        gaps.push_back(static_cast<double>((times[i] - times[i - 1]).ns));
    const double usual = median(gaps);
    double total = 0;
    std::size_t count = 0;
    for (const double gap : gaps)
        if (gap < 1.5 * usual) total += gap, ++count;
    return total / static_cast<double>(count);
}

/// The first second in which the gyro scattered more than at rest.
std::optional<std::size_t> second_of_motion(const std::array<std::vector<float>, 3>& gyro,
                                            std::size_t per_second) {
    std::vector<double> scatters;
    for (std::size_t at = 0; at + per_second <= gyro[0].size(); at += per_second) {
        double scatter = 0;
        for (const auto& axis : gyro) {
            double sum = 0;
            double squares = 0;
            for (std::size_t i = at; i < at + per_second; ++i) {
                sum += axis[i];
                squares += double{axis[i]} * axis[i];
            }
            const auto count = static_cast<double>(per_second);
            scatter += (squares - sum * sum / count) / count;
        }
        scatters.push_back(std::sqrt(std::max(scatter, 0.0)));
    }
    const double limit = motion_factor * median(scatters);
    for (std::size_t i = 0; i < scatters.size(); ++i)
        if (scatters[i] > limit) return i;
    return std::nullopt;
}

/// Sigma of single values, by the steps between them; those that repeat have none.
double scatter_of(const std::vector<float>& rates) {
    std::vector<float> steps;
    for (std::size_t i = 1; i < rates.size(); ++i)
        if (rates[i] != rates[i - 1]) steps.push_back(std::abs(rates[i] - rates[i - 1]));
    return steps.empty() ? 0 : sigma_of_median * median(std::move(steps)) / std::sqrt(2.0);
}

/// Replaces each spike; how many there were.
std::uint64_t take_off_spikes(std::vector<float>& rates) {
    const double limit = spike_sigmas * scatter_of(rates);
    std::uint64_t spikes = 0;
    for (std::size_t i = 0; i < rates.size(); ++i) {
        const std::size_t from = i < spike_reach ? 0 : i - spike_reach;
        const std::size_t to = std::min(i + spike_reach + 1, rates.size());
        const auto begin = rates.begin();
        const float usual = median(std::vector<float>(begin + static_cast<std::ptrdiff_t>(from),
                                                      begin + static_cast<std::ptrdiff_t>(to)));
        if (std::abs(rates[i] - usual) <= limit) continue;
        rates[i] = usual;
        ++spikes;
    }
    return spikes;
}

/// What is missing before the `at`th sample, as the samples before it scatter about a line.
void fill(std::vector<float>& even, float next, std::size_t missing) {
    const std::size_t end = even.size();
    const float last = even[end - 1];
    // Of the samples before: as many, or again and again those that there are.
    const std::size_t pattern = std::min(missing, end - 1);
    const float first = even[end - 1 - pattern];
    for (std::size_t k = 1; k <= missing; ++k) {
        const std::size_t step = (k - 1) % std::max<std::size_t>(pattern, 1) + 1;
        const float share = static_cast<float>(k) / static_cast<float>(missing + 1);
        float scatter = 0;
        if (pattern > 0)
            scatter = even[end - 1 - pattern + step] - first -
                      (last - first) * static_cast<float>(step) / static_cast<float>(pattern);
        even.push_back(last + (next - last) * share + scatter);
    }
}

std::vector<float> evened(const std::vector<OutputTime>& times, const std::vector<float>& rates,
                          double interval_ns) {
    std::vector<float> even;
    even.reserve(rates.size());
    for (std::size_t i = 0; i < rates.size(); ++i) {
        if (i > 0) {
            const auto gap = static_cast<double>((times[i] - times[i - 1]).ns);
            const auto steps = static_cast<std::int64_t>(std::lround(gap / interval_ns));
            if (steps > 1) fill(even, rates[i], static_cast<std::size_t>(steps - 1));
        }
        even.push_back(rates[i]);
    }
    return even;
}

}  // namespace

Expected<RestingSeries> resting_series(const RestingImu& imu) {
    RestingSeries series;
    const std::size_t count = imu.times.size();
    if (count >= 2)
        series.duration_s = static_cast<double>((imu.times.back() - imu.times.front()).ns) * 1e-9;
    if (count < least_samples || series.duration_s < least_duration_s)
        return failure(imu.name, fmt::format("{} samples are too few", count),
                       "record some hours at rest");
    const double interval_ns = usual_interval_ns(imu.times);
    series.interval_s = interval_ns * 1e-9;
    const auto expected =
        static_cast<std::uint64_t>(std::llround(series.duration_s / series.interval_s)) + 1;
    series.missing = expected > count ? expected - count : 0;
    if (static_cast<double>(series.missing) > most_missing * static_cast<double>(expected))
        return failure(imu.name,
                       fmt::format("{} of {} samples are missing", series.missing, expected),
                       "record without loss: 'versavis info' says where it is");
    const auto take = [&](const std::array<std::vector<float>, 3>& from,
                          std::array<std::vector<float>, 3>& into) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            std::vector<float> rates = from[axis];
            series.spikes += take_off_spikes(rates);
            into[axis] = evened(imu.times, rates, interval_ns);
        }
    };
    take(imu.gyro, series.gyro);
    take(imu.accel, series.accel);
    if (const auto moved = second_of_motion(
            series.gyro, static_cast<std::size_t>(std::lround(1 / series.interval_s))))
        return failure(imu.name, fmt::format("it was moved {} s after the start", *moved),
                       "leave it at rest, or choose a part of the recording by --from and --to");
    if (static_cast<double>(series.spikes) > most_spikes * 6 * static_cast<double>(count))
        return failure(imu.name,
                       fmt::format("{} values are far off those beside them", series.spikes),
                       "check its cable and its power");
    return series;
}

}  // namespace versavis::client
