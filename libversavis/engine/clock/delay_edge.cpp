// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/delay_edge.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace versavis::clock {

namespace {

// Share of slots in which every message was late, and only the far part of the delays counts.
// Half or twice: no figure changes by more than 2 %.
constexpr double tail_share = 0.15;

// How much longer the far part of the delays is than the near one. Half or twice: no figure
// changes by more than 2 %.
constexpr double tail_length = 20.0;

// A scale is not believed to be smaller. Half or twice: no link of the bench is that sharp.
constexpr double smallest_scale_ns = 1000.0;

// What interrupts and cache misses blur an edge by. Half: sigma is a third too small with IMU
// packets. Twice: errors after a minute without contact grow by an eighth.
constexpr double smallest_blur_ns = 2000.0;

// The same as a share of the scale, for slow links. Half or twice: p99 of those changes by 4 %.
constexpr double relative_blur = 0.005;

// The scale counts as at least this share of the deviation, where the density would become
// numerically sharp. Half or twice: no figure changes by more than 3 %.
constexpr double least_scale_of_deviation = 0.3;

// A scale of n delays is raised by this over n. Half or twice: figures change by at most 4 %.
constexpr double caution_of_few = 2.0;

// Share of the shortest delays whose density gives the scale. Half: it scatters, and errors grow
// by a tenth. Twice: the body of the delays counts, and a slower link costs a fifth more.
constexpr double judged_share = 0.25;

// Fewer delays give no scale. Half: p99 of invisible jitter grows by half. Twice: p99 of visible
// jitter grows by a fifth.
constexpr std::size_t delays_to_judge = 3;

// A scale spans at least this many delays; a difference of fewer is mostly chance. Half: p99 at
// one exchange a second grows by a sixth. Twice: nothing changes.
constexpr std::size_t least_rank = 4;

// Slots that show a burst of load, or a slower link. Half or twice: p99 at one exchange a second
// grows by a sixth.
constexpr std::size_t newest = 8;

// By how much the lower quarter of delays may exceed that of a sharp edge by chance, as a share of
// the lower half. Half: sharp edges are overshot. Twice: less is subtracted for late wake-ups.
constexpr double bend_slack = 0.1;

// Overshoot for each ns of bend, as of log-normal wake-ups. Half: late wake-ups cost a fifth
// more. Twice: NEES over USB rises to 1.6.
constexpr double overshoot_by_bend = 5.0;

// The overshoot is at most this share of the lower half of delays. Half: late wake-ups cost a
// quarter more. Twice: with IMU packets p99 grows by a tenth.
constexpr double most_overshoot_of_half = 0.6;

// No host takes longer to wake up when it is quick. Half: late wake-ups cost a tenth more. Twice:
// a slower link costs a tenth more.
constexpr double largest_overshoot_ns = 20e3;

// Windows that the shape is averaged over; one ends with each slot. Half: p99 grows by 4 %.
// Twice: nothing changes within a quarter of an hour.
constexpr std::size_t shape_memory = 256;

/// log(4/3) / log(2): a quarter of exponential excesses are below this share of their median.
const double exponential_bend = 0.4150374992788438;

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
    const double near_scale = std::max(scale, least_scale_of_deviation * deviation);
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

void DelayEdge::offer(const OffsetSample& sample, double delay_ns) {
    if (shortest_ && delay_ns >= shortest_ns_) return;
    shortest_ = sample;
    shortest_ns_ = delay_ns;
}

std::optional<OffsetSample> DelayEdge::take() { return std::exchange(shortest_, std::nullopt); }

void DelayEdge::begin(double scale_ns) {
    shortest_.reset();
    samples_.clear();
    newest_least_ns_.reset();
    shape_ = {};
    scale_ns_ = scale_ns;
}

std::optional<double> delay_scale(std::vector<double>& delays_ns) {
    const std::size_t count = delays_ns.size();
    if (count < delays_to_judge) return std::nullopt;
    const auto judged = static_cast<std::size_t>(judged_share * static_cast<double>(count));
    const std::size_t rank = std::min(std::max(judged, least_rank), count / 2);
    const auto highest = delays_ns.begin() + static_cast<std::ptrdiff_t>(rank);
    std::nth_element(delays_ns.begin(), highest, delays_ns.end());
    const double above_least = *highest - *std::min_element(delays_ns.begin(), highest);
    const double caution = 1 + caution_of_few / static_cast<double>(count);
    return std::max(smallest_scale_ns,
                    caution * above_least * static_cast<double>(count) / static_cast<double>(rank));
}

/// In a burst of load delays spread more than they did for long, and say less.
void DelayEdge::rescale() {
    judge_shape();
    newest_.assign(delays_.end() - static_cast<std::ptrdiff_t>(std::min(newest, delays_.size())),
                   delays_.end());
    newest_least_ns_.reset();
    if (newest_.size() == newest)
        newest_least_ns_ = *std::min_element(newest_.begin(), newest_.end());
    const double usual = delay_scale(delays_).value_or(scale_ns_);
    scale_ns_ = std::max(usual, delay_scale(newest_).value_or(0));
}

void DelayEdge::judge_shape() {
    if (delays_.size() < remembered_slots) return;
    sorted_ = delays_;
    std::sort(sorted_.begin(), sorted_.end());
    shape_.add(sorted_);
}

void DelayShape::add(const std::vector<double>& sorted_ns) {
    judged_ = std::min(judged_ + 1, shape_memory);
    const double gain = 1 / static_cast<double>(judged_);
    const double least = sorted_ns.front();
    lower_quarter_ns_ += gain * (sorted_ns[sorted_ns.size() / 4] - least - lower_quarter_ns_);
    lower_half_ns_ += gain * (sorted_ns[sorted_ns.size() / 2] - least - lower_half_ns_);
}

double DelayShape::overshoot_ns() const {
    const double bend = lower_quarter_ns_ - (exponential_bend + bend_slack) * lower_half_ns_;
    const double most = std::min(largest_overshoot_ns, most_overshoot_of_half * lower_half_ns_);
    return std::clamp(overshoot_by_bend * bend, 0.0, most);
}

double edge_blur(double scale_ns) { return std::max(smallest_blur_ns, relative_blur * scale_ns); }

}  // namespace versavis::clock
