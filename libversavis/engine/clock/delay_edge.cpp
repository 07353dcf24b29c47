// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/delay_edge.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace versavis::clock {

namespace {

constexpr double tail_share = 0.15;
constexpr double tail_length = 20.0;       // scales
constexpr double smallest_scale = 1000.0;  // ns
constexpr double smallest_blur = 2000.0;   // ns: interrupts, cache misses
constexpr double relative_blur = 0.005;
constexpr std::size_t delays_to_judge = 3;
constexpr std::size_t least_rank = 4;  // a difference of fewer delays is mostly chance
constexpr std::size_t newest = 8;      // slots

// phi(u) / Phi(u) of the normal distribution, and log Phi(u), without underflow.
double inverse_mills(double u) {
    if (u < -6) return -u - 1 / u + 2 / (u * u * u) - 10 / (u * u * u * u * u);
    return std::exp(-0.5 * u * u) * 0.3989422804014327 / (0.5 * std::erfc(-u * M_SQRT1_2));
}
double log_phi(double u) {
    if (u < -6) return -0.5 * u * u - std::log(-u * 2.5066282746310002) - 1 / (u * u);
    return std::log(0.5 * std::erfc(-u * M_SQRT1_2));
}

struct Component {
    double log_density;
    Influence influence;
};

/// Exponential plus Gaussian (Grushka, Analytical Chemistry 44, 1972); its logarithm is concave.
Component exponential_gaussian(double excess, double deviation, double scale) {
    const double u = excess / deviation - deviation / scale;
    const double mills = inverse_mills(u);
    const double log_density = 0.5 * deviation * deviation / (scale * scale) - excess / scale -
                               std::log(scale) + log_phi(u);
    return {log_density,
            {1 / scale - mills / deviation, mills * (u + mills) / (deviation * deviation)}};
}

}  // namespace

Influence influence_of(double excess, double deviation, double scale) {
    const double near_scale = std::max(scale, 0.3 * deviation);
    const Component near = exponential_gaussian(excess, deviation, near_scale);
    const Component far = exponential_gaussian(excess, deviation, near_scale * tail_length);
    const double odds =
        std::exp(near.log_density - far.log_density) * (1 - tail_share) / tail_share;
    const double far_share = 1 / (1 + odds);
    const double near_share = 1 - far_share;
    const double score = near_share * near.influence.score + far_share * far.influence.score;
    const double spread = near.influence.score - far.influence.score;
    const double curvature = near_share * near.influence.curvature +
                             far_share * far.influence.curvature -
                             near_share * far_share * spread * spread;
    return {score, std::clamp(curvature, 0.0, 1 / (deviation * deviation))};
}

void DelayEdge::offer(const Passage& passage, double delay_ns) {
    if (shortest_ && delay_ns >= shortest_ns_) return;
    shortest_ = passage;
    shortest_ns_ = delay_ns;
}

std::optional<Passage> DelayEdge::take() { return std::exchange(shortest_, std::nullopt); }

void DelayEdge::begin(double scale_ns) {
    shortest_.reset();
    passages_.clear();
    newest_least_ns_.reset();
    scale_ns_ = scale_ns;
}

std::optional<double> delay_scale(std::vector<double>& delays_ns) {
    const std::size_t count = delays_ns.size();
    if (count < delays_to_judge) return std::nullopt;
    const std::size_t rank = std::min(std::max(count / 4, least_rank), count / 2);
    const auto quartile = delays_ns.begin() + static_cast<std::ptrdiff_t>(rank);
    std::nth_element(delays_ns.begin(), quartile, delays_ns.end());
    const double above_least = *quartile - *std::min_element(delays_ns.begin(), quartile);
    const double caution = 1 + 2 / static_cast<double>(count);
    return std::max(smallest_scale,
                    caution * above_least * static_cast<double>(count) / static_cast<double>(rank));
}

/// In a burst of load delays spread more than they did for long, and say less.
void DelayEdge::rescale() {
    newest_.assign(delays_.end() - static_cast<std::ptrdiff_t>(std::min(newest, delays_.size())),
                   delays_.end());
    newest_least_ns_.reset();
    if (newest_.size() == newest)
        newest_least_ns_ = *std::min_element(newest_.begin(), newest_.end());
    const double usual = delay_scale(delays_).value_or(scale_ns_);
    scale_ns_ = std::max(usual, delay_scale(newest_).value_or(0));
}

double edge_blur(double scale_ns) { return std::max(smallest_blur, relative_blur * scale_ns); }

}  // namespace versavis::clock
