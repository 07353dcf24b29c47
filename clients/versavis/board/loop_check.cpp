// SPDX-License-Identifier: BSD-3-Clause
#include "board/loop_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace versavis::client {

namespace {

/// How far an edge may be from its place.
constexpr std::int64_t tolerance_ns = 10'000;

/// Not negative.
std::int64_t modulo(std::int64_t value, std::int64_t period) {
    return (value % period + period) % period;
}

/// Where an edge lies in the period, from half a period before the pulse to half after.
std::int64_t phase(std::int64_t at, std::int64_t period) {
    return modulo(at + period / 2, period) - period / 2;
}

/// Edges that come once a period, and those that do not fit them.
struct Train {
    std::vector<std::int64_t> edges;
    std::int64_t phase_ns = 0;
    std::size_t strays = 0;
    std::size_t missing = 0;
    double period_ns = 0;
};

/// Around the phase that most edges have.
Train find_train(const std::vector<std::int64_t>& edges, std::int64_t period) {
    Train best;
    for (const std::int64_t candidate : edges) {
        Train train;
        std::int64_t sum = 0;
        for (const std::int64_t edge : edges) {
            const std::int64_t offset = phase(edge - candidate, period);
            if (std::abs(offset) > tolerance_ns) continue;
            train.edges.push_back(edge);
            sum += offset;
        }
        const auto count = static_cast<std::int64_t>(train.edges.size());
        train.phase_ns = phase(candidate + sum / count, period);
        if (train.edges.size() > best.edges.size()) best = std::move(train);
    }
    if (best.edges.size() < 2) return best;
    const std::int64_t span = best.edges.back() - best.edges.front();
    const std::int64_t periods = (span + period / 2) / period;
    best.strays = edges.size() - best.edges.size();
    best.missing = static_cast<std::size_t>(
        std::max<std::int64_t>(0, periods + 1 - static_cast<std::int64_t>(best.edges.size())));
    if (periods > 0) best.period_ns = static_cast<double>(span) / static_cast<double>(periods);
    return best;
}

bool close(std::int64_t a, std::int64_t b) { return std::abs(a - b) <= tolerance_ns; }

std::string in_us(std::int64_t ns) {
    return fmt::format("{:.1f} us", static_cast<double>(ns) * 1e-3);
}

std::string complaint(const SentPulses& sent, const Train& rising, const Train& falling,
                      std::int64_t width) {
    const std::size_t strays = rising.strays + falling.strays;
    const std::size_t missing = rising.missing + falling.missing;
    if (rising.edges.size() < sent.count || falling.edges.size() < sent.count || missing > 0)
        return fmt::format(
            "{} of {} edges arrived: check the wire's contacts",
            rising.edges.size() + falling.edges.size(),
            std::max(2 * sent.count, rising.edges.size() + falling.edges.size() + missing));
    if (strays > 0)
        return fmt::format("{} edges more than were sent: check ground, and keep the wire short",
                           strays);
    if (close(rising.phase_ns, sent.width.ns) && close(falling.phase_ns, 0))
        return "the line is inverted: check what drives it, and its wiring";
    if (!close(rising.phase_ns, 0))
        return fmt::format(
            "pulses begin {} after they were sent: check what drives the line, and "
            "its pull-up",
            in_us(rising.phase_ns));
    if (!close(width, sent.width.ns))
        return fmt::format("pulses are {} wide, {} were sent: check the line's pull-up and load",
                           in_us(width), in_us(sent.width.ns));
    return "";
}

}  // namespace

bool hears(const SentPulses& sent, const std::vector<std::int64_t>& rising_ns) {
    const Train train = find_train(rising_ns, sent.period.ns);
    // A line that floats may have a few edges at any phase.
    return train.edges.size() >= 2 && 2 * train.edges.size() >= sent.count &&
           2 * train.edges.size() > rising_ns.size();
}

LoopFinding check_loop(const SentPulses& sent, const SeenEdges& seen) {
    if (!hears(sent, seen.rising_ns)) return {};
    const Train rising = find_train(seen.rising_ns, sent.period.ns);
    const Train falling = find_train(seen.falling_ns, sent.period.ns);
    LoopFinding finding;
    const std::int64_t width = modulo(falling.phase_ns - rising.phase_ns, sent.period.ns);
    finding.period.ns = std::llround(rising.period_ns);
    finding.width.ns = falling.edges.empty() ? 0 : width;
    finding.hint = complaint(sent, rising, falling, width);
    finding.result = finding.hint.empty() ? LoopResult::ok : LoopResult::failed;
    return finding;
}

}  // namespace versavis::client
