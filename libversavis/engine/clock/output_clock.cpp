// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/output_clock.hpp"

#include <utility>

namespace versavis::clock {

namespace {

// A reading between two of the host clock that are further apart is tried again. Half: most
// readings of a slow machine are. Twice: a stamp may carry 2 us of reading error.
constexpr Duration wide_reading = microseconds(2);

// Tries for a narrow reading. Half: a loaded machine gets a wide one more often, and sigma says
// so. Twice: a stamp may cost twice as much there.
constexpr int most_tries = 8;

// A smaller step of the output clock goes unnoticed. Half: reading noise could pass for a step and
// begin an epoch. Twice: a step of up to 2 us stays within an epoch.
constexpr Duration smallest_step = microseconds(1);

// A shorter suspend is taken for reading noise. No host suspends for half or for twice as long.
constexpr Duration smallest_suspend = milliseconds(1);

// How often steps and suspends are looked for while readings show none. Half: twice the system
// calls. Twice: a suspend may go unnoticed for 0.2 s of stamps.
constexpr Duration look_interval = milliseconds(100);

// How long after a step was seen the kernel may still report it. Half: a late report may count the
// step twice. Twice: a second step within two seconds may be missed if it shows no other way.
constexpr Duration longest_report = seconds(1);

// One over the fastest slew allowed for: the kernel slews by a tenth at most. Half: room for
// slews that do not exist. Twice: a clock slewed by a tenth seems to step.
constexpr int largest_slew = 8;

SystemClock system_clock(OutputClockKind kind) {
    return kind == OutputClockKind::tai ? SystemClock::tai : SystemClock::realtime;
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

Expected<OutputClock> OutputClock::create(OutputClockKind kind, bool force_tai,
                                          std::shared_ptr<SystemClocks> clocks) {
    if (kind == OutputClockKind::tai && !force_tai && clocks->kernel_state().tai_offset_s == 0)
        return failure("clock.output", "the kernel does not know the offset of TAI from UTC",
                       "let chrony (leapsectz right/UTC) or ptp4l and phc2sys set it, choose "
                       "'realtime', or set "
                       "force_tai = true to take UTC for TAI");
    return OutputClock(kind, std::move(clocks));
}

OutputClock::OutputClock(OutputClockKind kind, std::shared_ptr<SystemClocks> clocks)
    : kind_(kind), clocks_(std::move(clocks)), slept_(slept()), times_set_(clocks_->times_set()) {
    if (kind_ != OutputClockKind::monotonic_raw) stepped_from_monotonic(best_bracketed());
    next_look_ = read_host() + look_interval;
}

OutputReading OutputClock::read() {
    if (kind_ == OutputClockKind::monotonic_raw) {
        const HostTime now = read_host();
        if (now >= next_look_) look_for_steps(now, false);
        return {now, {}, {}, steps_};
    }
    BracketedReading reading = best_bracketed();
    const bool seen_step = stepped_from_monotonic(reading);
    if (seen_step || reading.width() > wide_reading || reading.after >= next_look_) {
        const std::uint32_t before = steps_;
        look_for_steps(reading.after, seen_step);
        if (steps_ != before && !seen_step) {  // it may have come after the reading
            reading = best_bracketed();
            stepped_from_monotonic(reading);
        }
    }
    const HostTime at = middle(reading.before, reading.after);
    return {at, {reading.output_ns - at.ns}, (reading.width() + nanoseconds(1)) / 2, steps_};
}

OutputClock::BracketedReading OutputClock::read_bracketed() {
    BracketedReading reading{};
    reading.before = read_host();
    reading.output_ns = clocks_->read_ns(system_clock(kind_));
    reading.monotonic_ns = clocks_->read_ns(SystemClock::monotonic);
    reading.after = read_host();
    return reading;
}

OutputClock::BracketedReading OutputClock::best_bracketed() {
    BracketedReading best = read_bracketed();
    for (int attempt = 1; attempt < most_tries && best.width() > wide_reading; ++attempt) {
        const BracketedReading next = read_bracketed();
        if (next.width() < best.width()) best = next;
    }
    return best;
}

/// Output clock minus CLOCK_MONOTONIC is a constant of the kernel between two steps, however it is
/// slewed.
bool OutputClock::stepped_from_monotonic(const BracketedReading& reading) {
    const std::int64_t read_later_ns = reading.output_ns - reading.monotonic_ns;
    const Bounds now{read_later_ns,
                     read_later_ns + reading.width().ns + reading.width().ns / largest_slew};
    const bool stepped = now.low_ns > against_monotonic_.high_ns + smallest_step.ns ||
                         now.high_ns < against_monotonic_.low_ns - smallest_step.ns;
    const bool narrower =
        now.high_ns - now.low_ns <= against_monotonic_.high_ns - against_monotonic_.low_ns;
    // A wide one that contradicts nothing would hide a step that follows.
    if (stepped || narrower || reading.width() <= wide_reading) against_monotonic_ = now;
    return stepped;
}

/// CLOCK_BOOTTIME counts suspends, the others do not.
OutputClock::Bounds OutputClock::slept() {
    const std::int64_t before_ns = clocks_->read_ns(SystemClock::monotonic);
    const std::int64_t boottime_ns = clocks_->read_ns(SystemClock::boottime);
    const std::int64_t after_ns = clocks_->read_ns(SystemClock::monotonic);
    return {boottime_ns - after_ns, boottime_ns - before_ns};
}

bool OutputClock::was_suspended() {
    const Bounds now = slept();
    const bool suspended = now.low_ns > slept_.high_ns + smallest_suspend.ns;
    if (suspended || now.high_ns < slept_.high_ns) slept_ = now;
    return suspended;
}

/// The kernel reports each time that CLOCK_REALTIME is set, once, some time after the new time can
/// be read.
bool OutputClock::was_set(HostTime now, bool seen_step) {
    const std::uint32_t times = clocks_->times_set();
    const bool reported = times != std::exchange(times_set_, times);
    const bool known = seen_step || now < set_is_known_until_;
    if (seen_step && !reported) set_is_known_until_ = now + longest_report;
    if (reported && !seen_step) set_is_known_until_ = {};
    // TAI goes on when UTC alone is stepped, as by a leap second: the comparison says all of it.
    return reported && !known && kind_ == OutputClockKind::realtime;
}

void OutputClock::look_for_steps(HostTime now, bool seen_step) {
    next_look_ = now + look_interval;
    const bool suspended = was_suspended();
    const bool set = was_set(now, seen_step);
    if (suspended) ++suspends_;
    if (suspended || set || seen_step) ++steps_;
}

}  // namespace versavis::clock
