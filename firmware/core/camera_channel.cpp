// SPDX-License-Identifier: BSD-3-Clause
#include "camera_channel.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds start_delay =
    5'000'000;  // from the command to the first grid point, at least
constexpr Nanoseconds start_timeout_floor = 2'000'000;
constexpr Nanoseconds start_timeout_limit = 50'000'000;
constexpr Nanoseconds latest_trigger = 1'000'000;

Nanoseconds max(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }
Nanoseconds min(Nanoseconds a, Nanoseconds b) { return a < b ? a : b; }

}  // namespace

void CameraChannel::configure(const wire::CameraConfiguration& configuration, Nanoseconds lead) {
    configuration_ = configuration;
    lead_ = lead > configuration.latency_ns ? lead - configuration.latency_ns : 0;
    next_tick_ = 0;
    expected_ = min(configuration.exposure_ns, configuration.max_exposure_ns);
    expected_since_ = 0;
    announcements_.clear();
    if (enabled()) grid_ = Grid(configuration.phase_ns, configuration.rate_uhz);
    wire::CameraConfiguration tracked = configuration;
    // A slave without an exposure line of its own is tracked by that of its master.
    if (has(wire::camera_slave) && has(wire::camera_no_strobe)) {
        tracked.flags &= ~std::uint32_t{wire::camera_no_strobe};
        tracked.latency_ns = 0;
    }
    tracker_.configure(tracked, min(max(period(), start_timeout_floor), start_timeout_limit));
}

void CameraChannel::start(Nanoseconds now, std::uint8_t flags) {
    if (!enabled()) return;
    if (!running_ && !is_slave()) {
        grid_ = Grid(configuration_.phase_ns, configuration_.rate_uhz);
        grid_.skip_before(clock_.grid_time(now));
        while (decision_time() < now || grid_.tick() < next_tick_ ||
               clock_.board_time(grid_.next()) < now + start_delay)
            grid_.advance();
    }
    running_ = true;
    uncounted_ = false;
    start_flags_ = flags;
    first_tick_ = grid_.tick();
}

void CameraChannel::announce(std::uint64_t trigger, Nanoseconds exposure) {
    const bool clipped = exposure > configuration_.max_exposure_ns;
    announcements_.add({trigger, clipped ? configuration_.max_exposure_ns : exposure, clipped});
}

Nanoseconds CameraChannel::expected_exposure() const {
    const Announcement* announced = announcements_.find(trigger_ + 1);
    return announced != nullptr ? announced->exposure : expected_;
}

Nanoseconds CameraChannel::trigger_time() const {
    return clock_.board_time(grid_.next()) - expected_exposure() / 2 - configuration_.latency_ns;
}

/// False for the gaps of the start pattern and of the slow start.
bool CameraChannel::wanted(std::uint64_t tick) const {
    const std::uint64_t since_start = tick - first_tick_;
    if ((start_flags_ & wire::start_slow) != 0) {
        return since_start % wire::slow_start_ticks(configuration_.rate_uhz, camera_) == 0;
    }
    if ((start_flags_ & wire::start_pattern) == 0 || since_start >= wire::start_pattern_length)
        return true;
    return (wire::start_pattern_bits[camera_] >> since_start & 1U) != 0;
}

void CameraChannel::decide(Nanoseconds now) {
    const Nanoseconds at = trigger_time();
    if (wanted(grid_.tick())) {
        if (at < now - min(latest_trigger, period() / 16))
            skip(wire::SkipReason::late, at);
        else if (tracker_.busy_until(now) + configuration_.gap_ns > at ||
                 pulse_end_ + OutputQueue::shortest_pause > at)
            skip(wire::SkipReason::busy, at);
        else if (tracker_.full() || !outputs_.has_room())
            skip(wire::SkipReason::full, at);
        else
            send_trigger(at, now);
    }
    grid_.advance();
    next_tick_ = grid_.tick();
}

void CameraChannel::skip(wire::SkipReason reason, Nanoseconds at) {
    ++skipped_;
    reports_.event(wire::EventKind::trigger_skipped, camera_, at,
                   static_cast<std::int64_t>(grid_.tick()), static_cast<std::uint16_t>(reason));
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

void CameraChannel::send_trigger(Nanoseconds at, Nanoseconds now) {
    const bool active = !trigger_inverted();
    const Nanoseconds sent = outputs_.pulse(max(at, now), camera_, active, configuration_.pulse_ns);
    pulse_end_ = sent + configuration_.pulse_ns;
    const Nanoseconds exposure = expected_exposure();
    wire::Exposure record = new_record(sent, grid_.tick());
    record.flags = phase_flags();
    if (sent > at) record.flags |= wire::exposure_late;
    if (const Announcement* announced = announcements_.find(trigger_)) {
        record.flags |= wire::exposure_announced;
        if (announced->clipped) record.flags |= wire::exposure_clipped;
        expected_ = announced->exposure;
        expected_since_ = trigger_;
        announcements_.used(trigger_);
    }
    tracker_.add(record, exposure);
    reports_.exposure_planned(camera_, sent + configuration_.latency_ns, exposure);
}

void CameraChannel::edge(Nanoseconds at, bool level) {
    if (!has_strobe()) return;  // no exposure line is wired
    const ExposureTracker::Completed completed = tracker_.edge(at, exposing(level));
    // An exposure from before an announcement says nothing about those after it.
    if (completed.trigger != 0 && completed.trigger >= expected_since_)
        expected_ = min(completed.duration, configuration_.max_exposure_ns);
}

void CameraChannel::master_edge(Nanoseconds at, bool exposing, std::uint64_t tick) {
    const bool own_strobe = has_strobe();
    if (exposing && running_) {
        if (tracker_.full()) tracker_.give_up();
        wire::Exposure record = new_record(at, tick);
        if (!own_strobe) record.flags |= wire::exposure_from_master;
        if (uncounted_) record.flags |= wire::exposure_uncounted;
        tracker_.add(record, expected_);
    }
    if (!own_strobe && !tracker_.empty()) tracker_.edge(at, exposing);
}

void CameraChannel::poll(Nanoseconds now) {
    tracker_.expire(now);
    if (is_slave()) return;
    while (running_ && decision_time() <= now) decide(now);
}

Nanoseconds CameraChannel::next_wake() const {
    return min(running_ && !is_slave() ? decision_time() : never, tracker_.next_deadline());
}

}  // namespace versavis::firmware
