// SPDX-License-Identifier: BSD-3-Clause
#include "arrival_check.hpp"

namespace versavis::daemon {

namespace {

/// What a message may be ahead of the host by, beside the error of the estimate: a first estimate
/// over a slow link may be off by so much.
constexpr Duration ahead_slack = milliseconds(1);

/// Sigmas of the estimate on top.
constexpr std::int64_t ahead_sigmas = 6;

/// A board holds messages no longer than this while nobody reads.
constexpr Duration oldest = seconds(10);

}  // namespace

std::optional<Implausibility> contradicts_arrival(BoardTime at, HostTime received,
                                                  const clock::Translator& translator) {
    const auto estimate = translator.to_host(at);
    if (!estimate) return std::nullopt;
    const Duration age = received - estimate->time;
    // As the estimate is good for now: far from now it is so bad that it explains any lie.
    const auto present = translator.to_host(at + age);
    if (!present) return std::nullopt;
    const Duration uncertainty = present->sigma * ahead_sigmas;
    if (age < -(ahead_slack + uncertainty))
        return Implausibility{EventReason::not_yet, at.ns, (at + age).ns};
    if (age > oldest + uncertainty)
        return Implausibility{EventReason::too_old, at.ns, (at + age).ns};
    return std::nullopt;
}

}  // namespace versavis::daemon
