// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/allan.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "evaluate/allan_report.hpp"
#include "evaluate/resting_series.hpp"

namespace versavis::client {

namespace {

// Share of the variance of flicker noise in its square: 2 ln 2 / pi (IEEE 952, annex C).
constexpr double flicker_share = 0.4412712;

// Relative sigma up to which a random walk counts as seen. If lower, recordings must be longer; if
// higher, the value says little more than its order of magnitude.
constexpr double seen_sigma = 0.25;

// A slope of -1/2 +- this is white noise. If lower, chance looks like another noise; if higher,
// more of a filter's flat shoulder is fitted, and the density comes out too small.
constexpr double slope_tolerance = 0.05;

// Where no slope is so good, the best one will do up to this. If lower, noisy parts in short
// recordings are refused; if higher, a part without white noise gets a density.
constexpr double worst_slope = 0.2;

// Averaging times needed to separate three noises. If lower, there are no more of them than
// unknowns; if higher, recordings need 4096 samples behind a filter's shoulder.
constexpr std::size_t least_points = 6;

// Correlation of deviations at neighbouring octaves widens sigma by this; found from simulated
// noise, where it makes the errors in sigmas one.
constexpr double widening = 1.45;

double square(double x) { return x * x; }

/// Equivalent degrees of freedom of the overlapping estimate for white noise of the rate, of `n`
/// integrals at `m` intervals (W. Riley, Handbook of frequency stability analysis, NIST SP 1065,
/// 2008, table 5).
double freedom_white(double n, double m) {
    return (3 * (n - 1) / (2 * m) - 2 * (n - 2) / n) * 4 * m * m / (4 * m * m + 5);
}

/// The same for a random walk of the rate.
double freedom_walk(double n, double m) {
    return (n - 2) / m * (square(n - 1) - 3 * m * (n - 1) + 4 * m * m) / square(n - 3);
}

/// Relative sigma of a variance.
double variance_sigma(double n, double m, bool walk) {
    const double freedom = walk ? freedom_walk(n, m) : freedom_white(n, m);
    return std::sqrt(2 / std::max(freedom, 1.0));
}

/// The three noises of the model: variance = white / tau + floor + walk tau / 3.
struct Noises {
    Eigen::Vector3d squares = Eigen::Vector3d::Zero();  ///< white, floor, walk
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    double misfit = 0;

    double at(double tau) const { return terms(tau).dot(squares); }
    static Eigen::Vector3d terms(double tau) { return {1 / tau, flicker_share, tau / 3}; }
};

/// Weighted least squares of the noises in `used`; the others are none.
Noises fit_some(std::span<const AllanPoint> points, unsigned used) {
    Noises noises;
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (int pass = 0; pass < 6; ++pass) {
        information.setZero();
        Eigen::Vector3d right = Eigen::Vector3d::Zero();
        noises.misfit = 0;
        for (const AllanPoint& point : points) {
            const double variance = square(point.deviation);
            const double expected = pass == 0 ? variance : std::max(noises.at(point.tau_s), 1e-300);
            const double sigma = 2 * point.relative_sigma * expected;
            Eigen::Vector3d terms = Noises::terms(point.tau_s);
            for (int i = 0; i < 3; ++i)
                if ((used >> i & 1U) == 0) terms[i] = 0;
            information += terms * terms.transpose() / square(sigma);
            right += terms * variance / square(sigma);
            noises.misfit += square((variance - expected) / sigma);
        }
        // Each unknown by its own size, lest the smallest be lost to rounding.
        Eigen::Vector3d scale;
        for (int i = 0; i < 3; ++i)
            scale[i] = information(i, i) > 0 ? 1 / std::sqrt(information(i, i)) : 1;
        Eigen::Matrix3d scaled = scale.asDiagonal() * information * scale.asDiagonal();
        for (int i = 0; i < 3; ++i)
            if ((used >> i & 1U) == 0) scaled(i, i) = 1;
        const Eigen::Matrix3d inverse = scaled.inverse();
        noises.covariance = scale.asDiagonal() * inverse * scale.asDiagonal();
        noises.squares = noises.covariance * right;
        for (int i = 0; i < 3; ++i)
            if ((used >> i & 1U) == 0) noises.squares[i] = 0;
        if (noises.squares.minCoeff() < 0) break;  // not physical: another set of noises fits
    }
    return noises;
}

/// No noise has a negative square: of the sets of noises without one, the set that fits best.
std::optional<Noises> fit(std::span<const AllanPoint> points) {
    std::optional<Noises> best;
    for (const unsigned used : {7U, 5U, 3U, 1U}) {  // white noise always is
        const Noises noises = fit_some(points, used);
        if (noises.squares.minCoeff() < 0 || noises.squares[0] <= 0) continue;
        if (!best || noises.misfit < best->misfit) best = noises;
    }
    return best;
}

/// Sigma of the walk's square that points of `n` integrals would leave.
double walk_square_sigma(const Noises& noises, double n, double interval_s, std::size_t first) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (std::size_t m = first; 3 * static_cast<double>(m) <= n; m *= 2) {
        const double tau = static_cast<double>(m) * interval_s;
        const bool walk = noises.squares[2] * tau * tau / 3 > noises.squares[0];
        const double sigma =
            variance_sigma(n, static_cast<double>(m), walk) * noises.at(tau) * widening;
        const Eigen::Vector3d terms = Noises::terms(tau);
        information += terms * terms.transpose() / square(sigma);
    }
    const Eigen::Vector3d scale = information.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::Matrix3d scaled = scale.asDiagonal() * information * scale.asDiagonal();
    return std::sqrt(std::max(scaled.inverse()(2, 2), 0.0)) * scale[2];
}

double needed_s(Noises noises, double walk_square, double n, double interval_s, std::size_t first) {
    noises.squares[2] = walk_square;
    for (int doubling = 0; doubling < 40; ++doubling, n *= std::sqrt(2))
        if (walk_square_sigma(noises, n, interval_s, first) < 2 * seen_sigma * walk_square) break;
    return n * interval_s;
}

/// The averaging time from which on white noise is seen: before it a filter or the steps of the
/// digits may show.
std::optional<std::size_t> first_white(std::span<const AllanPoint> points) {
    std::optional<std::size_t> best;
    double least = worst_slope;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        const double slope = std::log2(points[i + 1].deviation / points[i].deviation);
        const double off = std::abs(slope + 0.5);
        if (off <= slope_tolerance) return i;
        if (off > least) continue;
        least = off;
        best = i;
    }
    return best;
}

}  // namespace

std::vector<AllanPoint> allan_deviation(std::span<const float> rates, double interval_s) {
    const std::size_t n = rates.size();
    if (n < 3) return {};
    // Without the mean, which no second difference sees, the sums stay small.
    const double mean = std::accumulate(rates.begin(), rates.end(), 0.0) / static_cast<double>(n);
    std::vector<double> sums(n + 1, 0);
    for (std::size_t i = 0; i < n; ++i) sums[i + 1] = sums[i] + rates[i] - mean;
    std::vector<AllanPoint> points;
    for (std::size_t m = 1; 3 * m <= n; m *= 2) {
        double total = 0;
        for (std::size_t i = 0; i + 2 * m <= n; ++i)
            total += square(sums[i + 2 * m] - 2 * sums[i + m] + sums[i]);
        const auto count = static_cast<double>(n + 1 - 2 * m);
        const auto intervals = static_cast<double>(m);
        const double deviation = std::sqrt(total / (2 * count)) / intervals;
        const double sigma = variance_sigma(static_cast<double>(n + 1), intervals, false) / 2;
        points.push_back({intervals * interval_s, deviation, sigma});
    }
    return points;
}

namespace {

/// Of noise alone.
Expected<AxisNoise> noise_without_drift(std::span<const float> rates, double interval_s) {
    AxisNoise axis;
    axis.points = allan_deviation(rates, interval_s);
    const bool silent = std::any_of(axis.points.begin(), axis.points.end(),
                                    [](const auto& point) { return point.deviation <= 0; });
    const auto first = silent ? std::nullopt : first_white(axis.points);
    if (!first || axis.points.size() - *first < least_points)
        return failure("allan",
                       "no white noise is visible: the deviation never falls with tau^-1/2",
                       "record longer at rest, with a part that measures as often as it is read");
    std::vector<AllanPoint> used(axis.points.begin() + static_cast<std::ptrdiff_t>(*first),
                                 axis.points.end());
    const auto n = static_cast<double>(rates.size() + 1);
    auto noises = fit(used);
    // The sigmas of long times once more, for the noise that they turned out to show.
    for (std::size_t i = 0; noises && i < used.size(); ++i) {
        const double tau = used[i].tau_s;
        const bool walk = noises->squares[2] * tau * tau / 3 > noises->squares[0];
        used[i].relative_sigma = variance_sigma(n, tau / interval_s, walk) / 2;
        axis.points[*first + i].relative_sigma = used[i].relative_sigma;
    }
    if (noises) noises = fit(used);
    if (!noises)
        return failure("allan", "no white noise remains after subtracting the other noises",
                       "record longer at rest");
    const auto root = [&](int i) {
        const double value = std::sqrt(noises->squares[i]);
        const double sigma = std::sqrt(noises->covariance(i, i)) * widening;
        return Measured{value, value > 0 ? sigma / (2 * value) : std::sqrt(sigma)};
    };
    axis.density = root(0);
    axis.white_from_s = used.front().tau_s;
    axis.flicker = root(1).value;
    const std::size_t first_m = std::size_t{1} << *first;
    const double square_sigma = walk_square_sigma(*noises, n, interval_s, first_m);
    const double walk_square = noises->squares[2];
    axis.walk_limit = std::sqrt(walk_square + 2 * square_sigma);
    if (walk_square > 0 && square_sigma <= 2 * seen_sigma * walk_square)
        axis.walk = Measured{std::sqrt(walk_square), square_sigma / (2 * std::sqrt(walk_square))};
    else
        axis.walk_needs_s = needed_s(*noises, square(axis.walk_limit), n, interval_s, first_m);
    return axis;
}

}  // namespace

Expected<AxisNoise> axis_noise(std::span<const float> rates, double interval_s) {
    auto axis = noise_without_drift(rates, interval_s);
    if (!axis) return axis;
    const BiasHistory history =
        bias_history(rates, interval_s, axis->density.value, axis->white_from_s);
    if (history.drift) {
        std::vector<float> steady(rates.begin(), rates.end());
        for (std::size_t i = 0; i < steady.size(); ++i)
            steady[i] -= static_cast<float>(history.drift->at(static_cast<double>(i) * interval_s));
        axis = noise_without_drift(steady, interval_s);
        if (!axis) return axis;
        axis->drift = history.drift;
        axis->walk_limit = std::max(axis->walk_limit, history.walk_limit);
    }
    axis->smooth = history.smooth;
    if (axis->smooth) {
        axis->walk.reset();
        axis->walk_needs_s = 0;
    }
    return axis;
}

namespace {

Expected<> noise_of(const std::array<std::vector<float>, 3>& rates, const char* what,
                    const std::string& name, double interval_s, std::array<AxisNoise, 3>& axes) {
    for (std::size_t i = 0; i < 3; ++i) {
        auto noise = axis_noise(rates[i], interval_s);
        if (!noise)
            return failure(fmt::format("{}, {} {}", name, what, "xyz"[i]), noise.error().what,
                           noise.error().cure);
        axes[i] = std::move(*noise);
    }
    return {};
}

}  // namespace

Expected<AllanResult> evaluate_allan(const RestingImu& imu) {
    const auto series = resting_series(imu);
    if (!series) return Unexpected(series.error());
    AllanResult result;
    result.name = imu.name;
    result.rate_hz = 1 / series->interval_s;
    result.duration_s = series->duration_s;
    result.missing = series->missing;
    result.spikes = series->spikes;
    auto done = noise_of(series->gyro, "gyro", imu.name, series->interval_s, result.gyro);
    if (done)
        done = noise_of(series->accel, "accelerometer", imu.name, series->interval_s, result.accel);
    if (!done) return Unexpected(done.error());
    return result;
}

Measured density_of(const std::array<AxisNoise, 3>& axes) {
    double squares = 0;
    double weighted = 0;
    for (const AxisNoise& axis : axes) {
        squares += square(axis.density.value) / 3;
        weighted += square(axis.density.value * axis.density.sigma) / 9;
    }
    const double value = std::sqrt(squares);
    return {value, std::sqrt(weighted) / value};
}

std::optional<Measured> walk_of(const std::array<AxisNoise, 3>& axes) {
    double squares = 0;
    double weighted = 0;
    for (const AxisNoise& axis : axes) {
        if (!axis.walk) return std::nullopt;
        squares += square(axis.walk->value) / 3;
        weighted += square(axis.walk->value * axis.walk->sigma) / 9;
    }
    const double value = std::sqrt(squares);
    return Measured{value, std::sqrt(weighted) / value};
}

bool is_smooth(const AllanResult& result) {
    const auto smooth = [](const AxisNoise& axis) { return axis.smooth; };
    return std::any_of(result.gyro.begin(), result.gyro.end(), smooth) ||
           std::any_of(result.accel.begin(), result.accel.end(), smooth);
}

double walk_needs_s(const AllanResult& result) {
    double longest = 0;
    for (const auto* axes : {&result.gyro, &result.accel})
        for (const AxisNoise& axis : *axes)
            if (!axis.walk) longest = std::max(longest, axis.walk_needs_s);
    return longest;
}

Expected<std::string> kalibr_imu_yaml(const AllanResult& result, const std::string& topic) {
    if (is_smooth(result))
        return failure(
            result.name,
            "its bias changes too smoothly for a random walk, as with a temperature: that "
            "walk is not known",
            "record again at a constant temperature, after it has warmed up");
    const auto gyro_walk = walk_of(result.gyro);
    const auto accel_walk = walk_of(result.accel);
    if (!gyro_walk || !accel_walk)
        return failure(result.name,
                       fmt::format("{} are too short to show the random walk of each axis",
                                   span_text(result.duration_s)),
                       fmt::format("record at least {} at rest", span_text(walk_needs_s(result))));
    return fmt::format(
        "# Of {} at rest for {}: root mean square of the axes.\n"
        "accelerometer_noise_density: {:.4e}\n"
        "accelerometer_random_walk: {:.4e}\n"
        "gyroscope_noise_density: {:.4e}\n"
        "gyroscope_random_walk: {:.4e}\n"
        "rostopic: {}\n"
        "update_rate: {:.3f}\n",
        result.name, span_text(result.duration_s), density_of(result.accel).value,
        accel_walk->value, density_of(result.gyro).value, gyro_walk->value, topic, result.rate_hz);
}

}  // namespace versavis::client
