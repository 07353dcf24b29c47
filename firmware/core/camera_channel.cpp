// SPDX-License-Identifier: BSD-3-Clause
#include "camera_channel.hpp"

namespace versavis::firmware {

namespace {

/// From the command to the first grid point, at least. If lower, two cameras that are started by
/// two commands may begin at different grid points more often; if higher, starts take longer.
constexpr Nanoseconds start_delay = 5'000'000;

/// A start of exposure is waited for one period, but at least and at most this long. If lower, slow
/// cameras are given up; if higher, a record waits longer.
constexpr Nanoseconds start_timeout_floor = 2'000'000;
constexpr Nanoseconds start_timeout_limit = 50'000'000;

/// A trigger that is later than this, or than a sixteenth of the period, is skipped. If lower, a
/// slow poll skips triggers; if higher, exposures lie further from their grid points.
constexpr Nanoseconds latest_trigger = 1'000'000;

/// Most that the detail of an event can count.
constexpr std::int64_t most_reported = 65'535;

Nanoseconds max(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }
Nanoseconds min(Nanoseconds a, Nanoseconds b) { return a < b ? a : b; }

}  // namespace

void CameraChannel::configure(const wire::CameraConfiguration& configuration, Nanoseconds lead) {
    if (configuration.rate_uhz != configuration_.rate_uhz) next_tick_ = 0;
    configuration_ = configuration;
    lead_ = max(lead - configuration.latency_ns, 0);
    expected_ = min(configuration.exposure_ns, configuration.max_exposure_ns);
    announcements_.clear();
    routed_from_ = routed_until_ = never;
    filter_.configure(configuration.glitch == 0 ? wire::default_glitch_ns
                                                : configuration.glitch * wire::glitch_unit_ns);
    if (enabled()) grid_ = Grid(configuration.phase_ns, configuration.rate_uhz);
    wire::CameraConfiguration tracked = configuration;
    // A slave without an exposure line of its own is tracked by that of its master.
    if (has(wire::camera_slave) && has(wire::camera_no_strobe)) {
        tracked.flags &= ~std::uint32_t{wire::camera_no_strobe};
        tracked.latency_ns = 0;
    }
    tracker().configure(tracked, min(max(period(), start_timeout_floor), start_timeout_limit));
}

void CameraChannel::start(Nanoseconds now, std::uint8_t flags) {
    if (!enabled() || is_slave()) return;
    if (!running_) {
        grid_ = Grid(configuration_.phase_ns, configuration_.rate_uhz);
        const Nanoseconds ahead =
            OutputQueue::horizon + lead_ + configuration_.latency_ns + expected_exposure() / 2;
        const Nanoseconds first = now + max(ahead, start_delay);
        grid_.skip_before(clock_.grid_time(first));
        if (grid_.tick() < next_tick_)
            grid_.advance_by(static_cast<std::int64_t>(next_tick_ - grid_.tick()));
        while (clock_.board_time(grid_.next()) < first) grid_.advance();
    }
    running_ = true;
    start_flags_ = flags;
    first_tick_ = grid_.tick();
    plan();
}

void CameraChannel::stop() {
    running_ = false;
    plan();
}

void CameraChannel::route(Nanoseconds at, bool clean) {
    running_ = true;
    uncounted_ = !clean;
    routed_from_ = at;
    routed_until_ = never;
}

void CameraChannel::unroute(Nanoseconds at, bool clean) {
    running_ = false;
    uncounted_ = uncounted_ || !clean;
    routed_until_ = at;
}

void CameraChannel::announce(std::uint64_t trigger, Nanoseconds exposure) {
    const bool clipped = exposure > configuration_.max_exposure_ns;
    announcements_.add({trigger, clipped ? configuration_.max_exposure_ns : exposure, clipped});
    plan();
}

Nanoseconds CameraChannel::expected_exposure() const {
    const Announcement* announced = announcements_.find(trigger_ + 1);
    return announced != nullptr ? announced->exposure : expected_;
}

/// Whatever the time of the next trigger depends on may have changed.
void CameraChannel::plan() {
    decide_at_ = never;
    if (!running_ || is_slave()) return;
    trigger_at_ =
        clock_.board_time(grid_.next()) - expected_exposure() / 2 - configuration_.latency_ns;
    decide_at_ = trigger_at_ - OutputQueue::horizon - lead_;
}

void CameraChannel::advance(std::int64_t ticks) {
    grid_.advance_by(ticks);
    next_tick_ = grid_.tick();
    plan();
}

/// False for the gaps of the start pattern and of the slow start.
bool CameraChannel::wanted(std::uint64_t tick) const {
    const std::uint64_t since_start = tick - first_tick_;
    if ((start_flags_ & wire::start_slow) != 0)
        return since_start % wire::slow_start_ticks(configuration_.rate_uhz, camera_) == 0;
    if ((start_flags_ & wire::start_pattern) == 0 || since_start >= wire::start_pattern_length)
        return true;
    return (wire::start_pattern_bits[camera_] >> since_start & 1U) != 0;
}

/// How many of the next `ticks` are wanted, without a loop over them.
std::int64_t CameraChannel::wanted_among(std::uint64_t since_start, std::int64_t ticks) const {
    const std::uint64_t end = since_start + static_cast<std::uint64_t>(ticks);
    if ((start_flags_ & wire::start_slow) != 0) {
        const std::uint64_t interval = wire::slow_start_ticks(configuration_.rate_uhz, camera_);
        const auto before = [interval](std::uint64_t tick) {
            return (tick + interval - 1) / interval;
        };
        return static_cast<std::int64_t>(before(end) - before(since_start));
    }
    if ((start_flags_ & wire::start_pattern) == 0) return ticks;
    std::int64_t gaps = 0;
    for (std::uint64_t tick = since_start; tick < end && tick < wire::start_pattern_length; ++tick)
        if ((wire::start_pattern_bits[camera_] >> tick & 1U) == 0) ++gaps;
    return ticks - gaps;
}

void CameraChannel::decide(Nanoseconds now, Nanoseconds settled) {
    const Nanoseconds late_by = now - min(latest_trigger, period() / 16) - trigger_at_;
    if (late_by > 0) return skip_late(late_by);
    if (wanted(grid_.tick())) {
        if (tracker_.busy_until(settled) + configuration_.gap_ns > trigger_at_ ||
            pulse_end_ + OutputQueue::shortest_pause > trigger_at_)
            skip(wire::SkipReason::busy);
        else if (tracker_.full() || !outputs_.has_room(camera_))
            skip(wire::SkipReason::full);
        else
            send_trigger(now);
    }
    advance(1);
}

void CameraChannel::skip(wire::SkipReason reason) {
    ++skipped_;
    reports_.event(wire::BoardEventKind::trigger_skipped, camera_, trigger_at_,
                   static_cast<std::int64_t>(grid_.tick()), static_cast<std::uint16_t>(reason));
}

/// The next trigger, and those after it that have passed as well.
void CameraChannel::skip_late(Nanoseconds late_by) {
    const std::int64_t ticks = min(late_by / period() + 1, most_reported);
    const std::int64_t skipped = wanted_among(grid_.tick() - first_tick_, ticks);
    if (ticks == 1 && skipped == 1) {
        skip(wire::SkipReason::late);
    } else if (skipped > 0) {
        skipped_ += static_cast<std::uint32_t>(skipped);
        reports_.event(wire::BoardEventKind::triggers_skipped, camera_, trigger_at_,
                       static_cast<std::int64_t>(grid_.tick()),
                       static_cast<std::uint16_t>(skipped));
    }
    advance(ticks);
}

std::uint16_t CameraChannel::phase_flags() const {
    if ((start_flags_ & wire::start_slow) != 0) return wire::exposure_slow;
    const bool pattern = (start_flags_ & wire::start_pattern) != 0 &&
                         grid_.tick() - first_tick_ < wire::start_pattern_length;
    return pattern ? std::uint16_t{wire::exposure_pattern} : std::uint16_t{0};
}

wire::Exposure CameraChannel::new_record(Nanoseconds at, std::uint64_t tick) {
    wire::Exposure record{};
    record.camera = camera_;
    record.trigger = ++trigger_;
    record.tick = tick;
    record.trigger_ns = at;
    record.start_ns = record.end_ns = wire::no_time;
    return record;
}

void CameraChannel::send_trigger(Nanoseconds now) {
    const bool active = !trigger_inverted();
    const Nanoseconds wanted_at = trigger_at_;
    const Nanoseconds sent =
        outputs_.pulse(max(wanted_at, now), camera_, active, configuration_.pulse_ns);
    pulse_end_ = sent + configuration_.pulse_ns;
    const Nanoseconds exposure = expected_exposure();
    wire::Exposure record = new_record(sent, grid_.tick());
    record.flags = phase_flags();
    if (outputs_.is_late(wanted_at, sent)) record.flags |= wire::exposure_late;
    if (const Announcement* announced = announcements_.find(trigger_)) {
        record.flags |= wire::exposure_announced;
        if (announced->clipped) record.flags |= wire::exposure_clipped;
        expected_ = announced->exposure;
        expected_since_ = trigger_;
        announcements_.used(trigger_);
    }
    tracker().add(record, exposure);
    reports_.exposure_planned(camera_, sent + configuration_.latency_ns, exposure);
}

bool CameraChannel::take_edge(Nanoseconds settled, Nanoseconds& at, bool& exposing) {
    return filter_.take(settled, at, exposing);
}

void CameraChannel::exposure_edge(Nanoseconds at, bool exposing) {
    if (!has_strobe()) return;  // no exposure line is wired
    const ExposureTracker::Completed completed = tracker().edge(at, exposing);
    // An exposure from before an announcement says nothing about those after it.
    if (completed.trigger < expected_since_) return;
    expected_ = completed.duration;
    plan();
}

void CameraChannel::master_edge(Nanoseconds at, bool exposing, std::uint64_t tick) {
    const bool own_strobe = has_strobe();
    if (exposing && at >= routed_from_ && at < routed_until_) {
        if (tracker_.full()) tracker().give_up();
        wire::Exposure record = new_record(at, tick);
        if (!own_strobe) record.flags |= wire::exposure_from_master;
        if (uncounted_) record.flags |= wire::exposure_uncounted;
        tracker().add(record, expected_);
    }
    if (!own_strobe && !tracker_.empty()) tracker().edge(at, exposing);
}

void CameraChannel::edges_lost() {
    filter_.edges_lost();
    // Pulses of a master that were lost are unknown here: what starts next may be theirs.
    if (is_slave())
        tracker().give_up();
    else
        tracker().edges_lost();
    uncounted_ = true;
}

void CameraChannel::poll(Nanoseconds now, Nanoseconds settled) {
    if (!dirty_ && settled < expiry_ && now < decide_at_) return;
    // A pulse that has not left yet causes no exposure.
    if (!outputs_.is_overdue(camera_, settled)) tracker_.expire(settled);
    for (unsigned i = 0; i < decisions_a_poll && decide_at_ <= now; ++i) decide(now, settled);
    expiry_ = tracker_.next_deadline();
    dirty_ = false;
}

Nanoseconds CameraChannel::next_wake(Nanoseconds lag) const {
    const Nanoseconds expiry = dirty_ ? tracker_.next_deadline() : expiry_;
    const Nanoseconds wake = min(expiry, filter_.next_wake());
    return min(decide_at_, wake == never ? never : wake + lag);
}

}  // namespace versavis::firmware
