// SPDX-License-Identifier: BSD-3-Clause
#include "edge_difference.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace versavis::daemon {

namespace {

/// How far a camera's exposure time is off the true one: it counts rows, and some leave out a fixed
/// part.
constexpr Duration exposure_rounding = microseconds(20);

/// Frames before anything is said.
constexpr unsigned frames_to_tell = 8;

/// A difference is a contradiction beyond so many sigma.
constexpr double significant_sigmas = 3;

/// Standard deviation of normal noise by the median of its absolute deviations, and that of the
/// median of n samples by theirs: factors of statistics, not of taste.
constexpr double sigma_per_deviation = 1.4826;
constexpr double sigma_of_median = 1.2533;

std::int64_t median(std::int64_t* begin, std::int64_t* end) {
    std::int64_t* half = begin + (end - begin) / 2;
    std::nth_element(begin, half, end);
    return *half;
}

double us(Duration duration) { return static_cast<double>(duration.ns) * 1e-3; }

}  // namespace

void EdgeDifference::set_line_delays(const LineDelays& lines) {
    report_ = {};
    report_.line = lines.line;
    report_.expected = lines.end.delay - lines.start.delay;
    report_.expected_sigma = {std::llround(std::hypot(lines.start.sigma.ns, lines.end.sigma.ns))};
    next_ = 0;
    agreed_ = rivals_ = 0;
    corrected_ = false;
    surplus_ = RunningEstimate({}, insignificant());
}

/// What may as well be the sigma of the delays, and the rounding of the camera's account. No honest
/// frame is further off than that, for else each that is believed would make room for a worse one.
Duration EdgeDifference::insignificant() const {
    return rounded(significant_sigmas *
                   std::hypot(report_.expected_sigma.ns, exposure_rounding.ns));
}

void EdgeDifference::learn(Duration surplus, Duration start_delay) {
    surplus_ns_[next_++ % surplus_ns_.size()] = surplus.ns;
    report_.frames = std::min(next_, surplus_ns_.size());
    if (!explains(surplus)) return dispute(surplus, start_delay);
    surplus_.learn(surplus);
    agreed_ = std::min(agreed_ + 1, frames_to_learn);
    rivals_ = 0;
}

/// A line is slow, never early: an exposure that shows too long ends late, one that shows too short
/// begins late, but not before its trigger. What is neither is another signal than the exposure.
void EdgeDifference::dispute(Duration surplus, Duration start_delay) {
    if (rivals_ == 0 || absolute(surplus - rival_.value()) > insignificant()) {
        rival_ = RunningEstimate(insignificant());
        rivals_ = 0;
    }
    rival_.learn(surplus);
    const Duration learned = rival_.value();
    const bool possible =
        learned <= slowest_edge && -learned <= std::min(start_delay, slowest_edge);
    if (++rivals_ < frames_to_learn || !possible) return;
    surplus_ = rival_;
    agreed_ = frames_to_learn;
    rivals_ = 0;
    corrected_ = absolute(learned) > insignificant();
}

EdgeCorrection EdgeDifference::correction() const {
    EdgeCorrection correction;
    const Duration surplus = surplus_.value();
    if (corrected_) (surplus.ns > 0 ? correction.end : correction.start) = absolute(surplus);
    // The camera's account is rounded; what is not taken off lies somewhere in the exposure.
    const Duration doubt = corrected_ ? exposure_rounding / 2 : surplus / 4;
    correction.sigma = rounded(std::hypot(doubt.ns, surplus_.deviation().ns));
    return correction;
}

EdgeReport EdgeDifference::report() const {
    EdgeReport report = report_;
    if (report.frames == 0) return report;
    auto samples = surplus_ns_;
    std::int64_t* end = samples.data() + report.frames;
    const std::int64_t surplus = median(samples.data(), end);
    for (std::int64_t* sample = samples.data(); sample != end; ++sample)
        *sample = std::abs(*sample - surplus);
    const double spread = sigma_per_deviation * static_cast<double>(median(samples.data(), end));
    report.difference = report.expected + Duration{surplus};
    report.sigma = {std::llround(
        std::hypot(sigma_of_median * spread / std::sqrt(static_cast<double>(report.frames)),
                   static_cast<double>(exposure_rounding.ns)))};
    report.correction = correction().middle();
    return report;
}

std::string line_hint(const EdgeReport& edges) {
    const double doubt = std::hypot(edges.sigma.ns, edges.expected_sigma.ns);
    const Duration surplus = edges.difference - edges.expected;
    if (edges.frames < frames_to_tell ||
        std::abs(static_cast<double>(surplus.ns)) < significant_sigmas * doubt)
        return "";
    return fmt::format(
        "{}: the exposure line shows {:.0f} us {} than the camera exposes, its delays explain "
        "{:.0f}{}: check its LineSource, its pull-up and load, and its polarity ('strobe'), or "
        "measure it and set 'strobe_rising_us' and 'strobe_falling_us'",
        edges.line, std::abs(us(edges.difference)), edges.difference.ns < 0 ? "less" : "more",
        us(edges.expected), edges.correction.ns == 0 ? "" : ", the rest is taken off the stamps");
}

}  // namespace versavis::daemon
