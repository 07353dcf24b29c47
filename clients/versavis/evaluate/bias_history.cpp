// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/bias_history.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace versavis::client {

namespace {

// More of them show a drift no better, and take the cube of the time.
constexpr std::size_t most_blocks = 128;
// Fewer do not distinguish a drift from a random walk.
constexpr std::size_t least_blocks = 32;
// A block lasts for so many averaging times of a filter's shoulder, which would look smooth in
// shorter ones.
constexpr double shoulders_per_block = 8;

// By what a drift must improve twice the logarithm of the likelihood: with two and three unknowns
// more, chance does in one of a thousand.
constexpr double gain_of_slope = 11;
constexpr double gain_of_settling = 16;

// Time constants that are tried, as shares of the recording.
constexpr std::array<double, 8> settling_shares{1.0 / 64, 1.0 / 32, 1.0 / 16, 1.0 / 8,
                                                1.0 / 5,  1.0 / 3,  1.0 / 2,  1.0};

// Correlations of what is left, at lags of one and more blocks, whose squares have a mean of 1 in
// white noise; beyond the limit chance is in one recording of ten thousand.
constexpr int correlation_lags = 8;
constexpr double most_correlation = 32;

// Sizes of random walk and flicker that are tried: their variance in a block against that of white
// noise.
constexpr double least_size = 1e-7;
constexpr double most_size = 1e5;
constexpr double size_step = 4;

std::vector<double> tried_sizes() {
    std::vector<double> list{0};
    for (double size = least_size; size < most_size; size *= size_step) list.push_back(size);
    return list;
}

/// Means of blocks, in units of the sigma that white noise gives them.
Eigen::VectorXd block_means(std::span<const float> rates, std::size_t blocks, std::size_t length,
                            double sigma) {
    Eigen::VectorXd means(blocks);
    double origin = 0;  // sums stay small
    for (std::size_t i = 0; i < blocks; ++i) {
        double sum = 0;
        for (std::size_t k = i * length; k < (i + 1) * length; ++k) sum += rates[k];
        const double mean = sum / static_cast<double>(length);
        if (i == 0) origin = mean;
        means[static_cast<Eigen::Index>(i)] = (mean - origin) / sigma;
    }
    return means;
}

/// Of the means of a random walk that gains a variance of 1 in a block.
Eigen::MatrixXd walk_covariance(Eigen::Index blocks) {
    Eigen::MatrixXd covariance(blocks, blocks);
    for (Eigen::Index i = 0; i < blocks; ++i)
        for (Eigen::Index k = 0; k < blocks; ++k)
            covariance(i, k) = static_cast<double>(std::min(i, k)) + (i == k ? 1.0 / 3 : 0.5);
    return covariance;
}

/// Flicker noise is near to a sum of processes of all time constants, each of the same
/// variance.
Eigen::MatrixXd flicker_covariance(Eigen::Index blocks) {
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(blocks, blocks);
    for (double constant = 0.5; constant < 2 * static_cast<double>(blocks); constant *= 3)
        for (Eigen::Index i = 0; i < blocks; ++i)
            for (Eigen::Index k = 0; k < blocks; ++k)
                covariance(i, k) += std::exp(-static_cast<double>(std::abs(i - k)) / constant);
    return covariance;
}

/// A constant, a slope, and settling with each of the time constants; time is 0 to 1.
Eigen::MatrixXd drift_shapes(Eigen::Index blocks) {
    Eigen::MatrixXd columns(blocks, 2 + static_cast<Eigen::Index>(settling_shares.size()));
    for (Eigen::Index i = 0; i < blocks; ++i) {
        const double t = (static_cast<double>(i) + 0.5) / static_cast<double>(blocks);
        columns(i, 0) = 1;
        columns(i, 1) = t;
        for (std::size_t k = 0; k < settling_shares.size(); ++k)
            columns(i, 2 + static_cast<Eigen::Index>(k)) = std::exp(-t / settling_shares[k]);
    }
    return columns;
}

constexpr double unlikely = std::numeric_limits<double>::infinity();

/// The best of one kind of drift. Costs are -2 log likelihood.
struct Fit {
    double cost = unlikely;
    /// For each size of the random walk the least one, restricted to what no drift can explain (D.
    /// Harville, JASA 72, 1977).
    std::vector<double> restricted;
    std::size_t constant = settling_shares.size();
    Eigen::VectorXd factors;  ///< of constant, slope, settling
    Eigen::VectorXd left;     ///< white, if noises and drift explain all
};

void improve(Fit& best, const Eigen::MatrixXd& white_shapes, const Eigen::VectorXd& white_means,
             double log_determinant, std::size_t walk, std::size_t constant) {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(white_shapes);
    const Eigen::VectorXd factors = qr.solve(white_means);
    const Eigen::VectorXd left = white_means - white_shapes * factors;
    const double cost = log_determinant + left.squaredNorm();
    best.restricted.resize(std::max(best.restricted.size(), walk + 1), unlikely);
    const double shown = qr.matrixQR().diagonal().array().abs().log().sum();
    best.restricted[walk] = std::min(best.restricted[walk], cost + 2 * shown);
    if (cost >= best.cost) return;
    best.cost = cost;
    best.constant = constant;
    best.factors = factors;
    best.left = left;
}

/// The largest size of the random walk that is not unlikely, at two standard deviations.
double largest_walk(const Fit& fit) {
    const auto& costs = fit.restricted;
    const std::vector<double> tried = tried_sizes();
    const double limit = *std::min_element(costs.begin(), costs.end()) + 4;
    std::size_t last = costs.size() - 1;
    while (last > 0 && costs[last] > limit) --last;
    if (last == 0 || last + 1 == costs.size()) return tried[std::min(last + 1, costs.size() - 1)];
    const double share = (limit - costs[last]) / (costs[last + 1] - costs[last]);
    return tried[last] * std::pow(size_step, share);
}

struct Fits {
    Fit constant;
    Fit slope;
    Fit settling;
};

Fits fit_all(const Eigen::VectorXd& means) {
    const Eigen::Index blocks = means.size();
    const Eigen::MatrixXd walk = walk_covariance(blocks);
    const Eigen::MatrixXd flicker = flicker_covariance(blocks);
    const Eigen::MatrixXd columns = drift_shapes(blocks);
    Fits fits;
    const std::vector<double> tried = tried_sizes();
    for (std::size_t size = 0; size < tried.size(); ++size)
        for (const double flicker_size : tried) {
            const Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(blocks, blocks) +
                                               tried[size] * walk + flicker_size * flicker;
            const Eigen::LLT<Eigen::MatrixXd> root(covariance);
            if (root.info() != Eigen::Success) continue;
            const Eigen::VectorXd white_means = root.matrixL().solve(means);
            const Eigen::MatrixXd white = root.matrixL().solve(columns);
            const double log_determinant =
                2 * root.matrixLLT().diagonal().array().abs().log().sum();
            improve(fits.constant, white.leftCols(1), white_means, log_determinant, size,
                    settling_shares.size());
            improve(fits.slope, white.leftCols(2), white_means, log_determinant, size,
                    settling_shares.size());
            Eigen::MatrixXd settling = white.leftCols(3);
            for (std::size_t k = 0; k < settling_shares.size(); ++k) {
                settling.col(2) = white.col(2 + static_cast<Eigen::Index>(k));
                improve(fits.settling, settling, white_means, log_determinant, size, k);
            }
        }
    return fits;
}

bool is_smooth(const Eigen::VectorXd& left) {
    const double energy = left.squaredNorm();
    if (energy <= 0) return false;
    const auto n = static_cast<double>(left.size());
    double sum = 0;
    for (int lag = 1; lag <= correlation_lags; ++lag) {
        const double product = left.head(left.size() - lag).dot(left.tail(left.size() - lag));
        sum += n * product * product / (energy * energy);
    }
    return sum > most_correlation;
}

}  // namespace

double BiasDrift::at(double t_s) const {
    return slope * t_s + (time_constant_s > 0 ? settling * std::exp(-t_s / time_constant_s) : 0);
}

BiasHistory bias_history(std::span<const float> rates, double interval_s, double density,
                         double white_from_s) {
    const double duration_s = static_cast<double>(rates.size()) * interval_s;
    const auto blocks = std::min(
        most_blocks, static_cast<std::size_t>(duration_s / (shoulders_per_block * white_from_s)));
    if (blocks < least_blocks) return {};
    const std::size_t length = rates.size() / blocks;
    const double block_s = static_cast<double>(length) * interval_s;
    const double sigma = density / std::sqrt(block_s);
    const Fits fits = fit_all(block_means(rates, blocks, length, sigma));
    const Fit* best = &fits.constant;
    if (fits.slope.cost < best->cost - gain_of_slope) best = &fits.slope;
    if (fits.settling.cost < std::min(fits.constant.cost - gain_of_settling,
                                      fits.slope.cost - (gain_of_settling - gain_of_slope)))
        best = &fits.settling;
    BiasHistory history;
    history.smooth = is_smooth(best->left);
    history.walk_limit = std::sqrt(largest_walk(*best)) * density / block_s;
    if (best == &fits.constant) return history;
    const double span_s = static_cast<double>(blocks) * block_s;
    history.drift.emplace();
    history.drift->slope = best->factors[1] * sigma / span_s;
    if (best == &fits.settling) {
        history.drift->settling = best->factors[2] * sigma;
        history.drift->time_constant_s = settling_shares[best->constant] * span_s;
    }
    return history;
}

}  // namespace versavis::client
