// SPDX-License-Identifier: BSD-3-Clause
#include "arrival_check.hpp"

namespace versavis::daemon {

namespace {

/// What a message may be ahead of the host by, beside the error of the estimate: a first estimate
/// over a slow link may be off by so much.
constexpr Duration first_slack = milliseconds(1);

/// The same once the clock is locked: no message takes less than this to the host.
constexpr Duration locked_slack = microseconds(20);

/// Sigmas of the estimate on top.
constexpr std::int64_t ahead_sigmas = 6;

/// A board holds messages no longer than this while nobody reads.
constexpr Duration oldest = seconds(10);

std::optional<Implausibility> doubt(BoardTime at, Duration age,
                                    const clock::HostEstimate& present) {
    const Duration uncertainty = present.sigma * ahead_sigmas;
    const Duration slack = present.state == clock::ClockState::locked ? locked_slack : first_slack;
    if (age < -(slack + uncertainty))
        return Implausibility{EventReason::not_yet, at.ns, (at + age).ns};
    if (age > oldest + uncertainty)
        return Implausibility{EventReason::too_old, at.ns, (at + age).ns};
    return std::nullopt;
}

}  // namespace

std::optional<ArrivalDelay> arrival_delay(BoardTime at, HostTime received,
                                          const clock::Translator& translator) {
    const auto estimate = translator.to_host(at);
    if (!estimate) return std::nullopt;
    const Duration age = received - estimate->time;
    // As the estimate is good for now: far from now it is so bad that it explains any lie.
    const auto present = translator.to_host(at + age);
    if (!present) return std::nullopt;
    return ArrivalDelay{age, present->spread, doubt(at, age, *present)};
}

std::optional<Implausibility> contradicts_arrival(BoardTime at, HostTime received,
                                                  const clock::Translator& translator) {
    const auto arrival = arrival_delay(at, received, translator);
    return arrival ? arrival->doubt : std::nullopt;
}

}  // namespace versavis::daemon
