// SPDX-License-Identifier: BSD-3-Clause
#include "stream/imu_witness.hpp"

namespace versavis::daemon {

namespace {

/// A part keeps its rate within this much of the configured one. At half, parts of 15 % less are
/// doubted at their first samples; at twice, the second sample may be a lie of half a period.
constexpr std::int64_t rate_parts = 4;

/// Over lost samples the pace may wander by this much of the time. At half, parts that warm up are
/// doubted after a gap; at twice, the first sample after a second's gap may be off by 4 ms.
constexpr std::int64_t wander_parts = 500;

}  // namespace

std::optional<Doubt> contradicts_itself(const wire::ImuSample& sample) {
    if (in_life(sample.time_ns)) return std::nullopt;
    return Doubt{EventReason::implausible_time, sample.time_ns, 0};
}

SampleHistory::SampleHistory(const ImuConfiguration& configuration)
    : pace_(Duration{static_cast<std::int64_t>(1e9 / configuration.rate_hz)},
            Duration{static_cast<std::int64_t>(1e9 / configuration.rate_hz)} / rate_parts) {}

std::optional<Doubt> SampleHistory::doubt(const wire::ImuSample& sample) const {
    if (!newest_) return std::nullopt;
    const auto samples = static_cast<std::int32_t>(sample.number - newest_->number);
    if (samples <= 0)
        return Doubt{EventReason::implausible_number, sample.number, newest_->number + 1};
    const Duration expected = pace_.value() * samples;
    const Duration off = Duration{sample.time_ns - newest_->time_ns} - expected;
    const Duration wander = pace_.value() * (samples - 1) / wander_parts;
    if (absolute(off) <= pace_.tolerance() + wander) return std::nullopt;
    return Doubt{EventReason::implausible_time, sample.time_ns, sample.time_ns - off.ns};
}

void SampleHistory::learn(const wire::ImuSample& sample) {
    if (newest_)
        pace_.learn(Duration{sample.time_ns - newest_->time_ns} /
                    static_cast<std::int32_t>(sample.number - newest_->number));
    newest_ = sample;
}

}  // namespace versavis::daemon
