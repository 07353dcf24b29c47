// SPDX-License-Identifier: BSD-3-Clause
#include "stream/edge_difference.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace versavis::daemon {

namespace {

/// How far a camera's exposure time is off the true one: it counts rows, and some leave out a fixed
/// part. At half, cameras with long rows seem to have slow lines; at twice, slow lines go unnoticed
/// below 0.12 ms.
constexpr Duration exposure_rounding = microseconds(20);

/// Frames before anything is said. At half, an exposure that just changed is named a fault; at
/// twice, it is said later.
constexpr unsigned frames_to_tell = 8;

/// A difference is a contradiction beyond so many sigma. At half, one line in ten is named without
/// a cause; at twice, slow pull-ups are found only when they take a millisecond.
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
    report_.line = lines.line;
    report_.frames = 0;
    report_.expected = lines.end.delay - lines.start.delay;
    report_.expected_sigma = {std::llround(std::hypot(lines.start.sigma.ns, lines.end.sigma.ns))};
    next_ = 0;
}

void EdgeDifference::paired(const pairing::Exposure& exposure, Duration told) {
    if (told.ns == 0 || exposure.kind != StampKind::measured_middle) return;
    surplus_ns_[next_++ % surplus_ns_.size()] = (exposure.end - exposure.start - told).ns;
    report_.frames = std::min(next_, surplus_ns_.size());
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
        "{:.0f}: check its LineSource, its pull-up and load, and its polarity ('strobe'), or "
        "measure it and set 'strobe_rising_us' and 'strobe_falling_us'",
        edges.line, std::abs(us(edges.difference)), edges.difference.ns < 0 ? "less" : "more",
        us(edges.expected));
}

}  // namespace versavis::daemon
