// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/clock/output_clock.hpp"

#include <sys/timex.h>

#include <ctime>

namespace versavis::clock {

namespace {

constexpr Duration wide_sandwich = microseconds(2);
constexpr int most_tries = 8;
constexpr Duration smallest_step = microseconds(200);

clockid_t clock_id(OutputClockKind kind) { return kind == OutputClockKind::tai ? CLOCK_TAI : CLOCK_REALTIME; }

std::int64_t read_ns(clockid_t id) {
    timespec now{};
    clock_gettime(id, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

const char* to_string(OutputClockKind kind) {
    switch (kind) {
        case OutputClockKind::realtime: return "realtime";
        case OutputClockKind::tai: return "tai";
        case OutputClockKind::monotonic_raw: return "monotonic_raw";
    }
    return "unknown";
}

Expected<OutputClock> OutputClock::create(OutputClockKind kind) {
    timex kernel{};
    if (kind == OutputClockKind::tai && (adjtimex(&kernel) < 0 || kernel.tai == 0))
        return failure("clock.output", "the kernel does not know the offset of TAI from UTC",
                       "let chrony (leapsectz right/UTC) or ptp4l/phc2sys set it, or choose 'realtime'");
    return OutputClock(kind);
}

OutputClock::OutputClock(OutputClockKind kind) : kind_(kind) {
    offset();
    steps_ = 0;
}

Duration OutputClock::offset() {
    if (kind_ == OutputClockKind::monotonic_raw) return {};
    Duration best_width = seconds(1);
    Duration best_offset;
    Duration best_against_monotonic;
    for (int attempt = 0; attempt < most_tries && best_width > wide_sandwich; ++attempt) {
        const HostTime before = host_now();
        const std::int64_t output_ns = read_ns(clock_id(kind_));
        const std::int64_t monotonic_ns = read_ns(CLOCK_MONOTONIC);
        const HostTime after = host_now();
        if (after - before >= best_width) continue;
        best_width = after - before;
        best_offset = {output_ns - middle(before, after).ns};
        best_against_monotonic = {output_ns - monotonic_ns};
    }
    // CLOCK_MONOTONIC is slewed together with the output clock, but never stepped: what parts them is a step.
    if (absolute(best_against_monotonic - against_monotonic_) > smallest_step) ++steps_;
    against_monotonic_ = best_against_monotonic;
    return best_offset;
}

}  // namespace versavis::clock
