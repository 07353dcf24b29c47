// SPDX-License-Identifier: BSD-3-Clause
#include "camera_channel.hpp"

namespace versavis::firmware {

namespace {

// Decided this long before it is due: late enough for the newest exposure, early enough for the commit
// horizon.
constexpr Nanoseconds decide_ahead = 1'500'000;
constexpr Nanoseconds start_timeout_floor = 2'000'000;
constexpr Nanoseconds start_timeout_limit = 50'000'000;

Nanoseconds max(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }
Nanoseconds min(Nanoseconds a, Nanoseconds b) { return a < b ? a : b; }

}  // namespace

void CameraChannel::start(Nanoseconds origin, Nanoseconds now, bool pattern) {
    if (!has(wire::camera_enabled)) return;
    if (!running_) {
        grid_ = Grid(origin + configuration_.phase_ns, configuration_.rate_uhz);
        grid_.skip_before(now);
        while (trigger_time() < now + decide_ahead) grid_.advance();
    }
    running_ = true;
    pattern_ = pattern;
    first_tick_ = grid_.tick();
}

void CameraChannel::configure(const wire::CameraConfiguration& configuration, Nanoseconds now) {
    configuration_ = configuration;
    expected_ = configuration.exposure_ns;
    expected_since_ = 0;
    announced_from_ = 0;
    flight_count_ = 0;
    outputs_.cancel(camera_, has(wire::camera_trigger_inverted), now);
}

void CameraChannel::announce(std::uint64_t trigger, Nanoseconds exposure) {
    announced_from_ = trigger;
    announced_ = min(exposure, configuration_.max_exposure_ns);
}

Nanoseconds CameraChannel::expected_exposure() const {
    const bool announced = announced_from_ != 0 && trigger_ + 1 >= announced_from_;
    return announced ? announced_ : expected_;
}

Nanoseconds CameraChannel::trigger_time() const {
    return grid_.next() - expected_exposure() / 2 - configuration_.latency_ns;
}

bool CameraChannel::in_pattern_gap() const {
    const std::uint64_t since_start = grid_.tick() - first_tick_;
    return pattern_ && since_start < wire::start_pattern_length &&
           (wire::start_pattern_bits >> since_start & 1U) == 0;
}

/// When the newest exposure will have ended, as far as it is known now.
Nanoseconds CameraChannel::busy_until(Nanoseconds now) const {
    if (flight_count_ == 0) return last_end_;
    const Flight& newest = flights_[flight_count_ - 1];
    const bool started = newest.record.start_ns != wire::no_time;
    const Nanoseconds start =
        started ? newest.record.start_ns : newest.record.trigger_ns + configuration_.latency_ns;
    const Nanoseconds end = start + newest.expected;
    return started && end < now ? INT64_MAX / 2 : end;  // overdue: it may last for any time
}

void CameraChannel::decide(Nanoseconds now) {
    const Nanoseconds at = trigger_time();
    if (!in_pattern_gap()) {
        if (flight_count_ == max_flights || !outputs_.has_room() ||
            busy_until(now) + configuration_.gap_ns > at)
            reports_.event(wire::EventKind::trigger_skipped, camera_, at,
                           static_cast<std::int64_t>(grid_.tick()));
        else
            send_trigger(at, now);
    }
    grid_.advance();
}

void CameraChannel::send_trigger(Nanoseconds at, Nanoseconds now) {
    const bool active = !has(wire::camera_trigger_inverted);
    const bool announced = announced_from_ != 0 && trigger_ + 1 >= announced_from_;
    const Nanoseconds exposure = expected_exposure();
    const Nanoseconds sent = outputs_.set(max(at, now), camera_, active);
    outputs_.set(sent + configuration_.pulse_ns, camera_, !active);
    ++trigger_;
    if (announced) {
        expected_ = announced_;
        expected_since_ = trigger_;
        announced_from_ = 0;
    }
    Flight& flight = flights_[flight_count_++];
    flight = {};
    flight.expected = exposure;
    flight.record.camera = camera_;
    flight.record.trigger = trigger_;
    flight.record.tick = grid_.tick();
    flight.record.trigger_ns = sent;
    flight.record.start_ns = flight.record.end_ns = wire::no_time;
    if (sent > at) flight.record.flags |= wire::exposure_late;
    if (announced) flight.record.flags |= wire::exposure_announced;
    if (pattern_ && grid_.tick() - first_tick_ < wire::start_pattern_length)
        flight.record.flags |= wire::exposure_pattern;
}

void CameraChannel::edge(Nanoseconds at, bool level) {
    if (!has(wire::camera_enabled) || has(wire::camera_no_strobe)) return;  // nothing is wired there
    expire(at);
    const bool exposing = level != has(wire::camera_strobe_inverted);
    if (exposing)
        start_edge(at);
    else
        end_edge(at);
}

/// The edge belongs to the newest trigger before it: older ones that wait for a start were ignored by the
/// camera.
void CameraChannel::start_edge(Nanoseconds at) {
    std::size_t found = max_flights;
    for (std::size_t i = 0; i < flight_count_; ++i)
        if (flights_[i].record.trigger_ns <= at && flights_[i].record.start_ns == wire::no_time) found = i;
    if (found == max_flights) {
        edges_lost();  // the line rose twice: an end in between was missed
        return reports_.event(wire::EventKind::stray_edge, camera_, at, 1);
    }
    // The line has one level: whatever still waits before this trigger was ignored, or its end edge was lost.
    for (; found > 0; --found) {
        flights_[0].record.flags |=
            flights_[0].record.start_ns == wire::no_time ? wire::exposure_no_start : wire::exposure_no_end;
        finish(0);
    }
    flights_[0].record.start_ns = at;
}

void CameraChannel::end_edge(Nanoseconds at) {
    for (std::size_t i = 0; i < flight_count_; ++i) {
        Flight& flight = flights_[i];
        if (flight.record.start_ns == wire::no_time) continue;
        flight.record.end_ns = at;
        flight.record.flags |= wire::exposure_measured;
        // An exposure from before an announcement says nothing of those after it.
        if (flight.record.trigger >= expected_since_) expected_ = at - flight.record.start_ns;
        return finish(i);
    }
    reports_.event(wire::EventKind::stray_edge, camera_, at, 0);
}

void CameraChannel::edges_lost() {
    while (flight_count_ > 0 && flights_[0].record.start_ns != wire::no_time) {
        flights_[0].record.flags |= wire::exposure_no_end;
        finish(0);
    }
}

Nanoseconds CameraChannel::deadline(const Flight& flight) const {
    if (has(wire::camera_no_strobe))
        return flight.record.trigger_ns + configuration_.latency_ns + flight.expected;
    if (flight.record.start_ns != wire::no_time)
        return flight.record.start_ns + configuration_.max_exposure_ns;
    const Nanoseconds patience = min(max(grid_.period(), start_timeout_floor), start_timeout_limit);
    return flight.record.trigger_ns + configuration_.latency_ns + patience;
}

void CameraChannel::expire(Nanoseconds now) {
    while (flight_count_ > 0 && deadline(flights_[0]) <= now) {
        Flight& flight = flights_[0];
        if (has(wire::camera_no_strobe))
            predict_edges(flight);
        else if (flight.record.start_ns == wire::no_time)
            flight.record.flags |= wire::exposure_no_start;
        else
            flight.record.flags |= wire::exposure_no_end;
        finish(0);
    }
}

void CameraChannel::predict_edges(Flight& flight) const {
    flight.record.flags |= wire::exposure_no_strobe;
    flight.record.start_ns = flight.record.trigger_ns + configuration_.latency_ns;
    flight.record.end_ns = flight.record.start_ns + flight.expected;
}

void CameraChannel::finish(std::size_t index) {
    const wire::Exposure record = flights_[index].record;
    if (record.end_ns != wire::no_time) last_end_ = record.end_ns;
    for (std::size_t i = index + 1; i < flight_count_; ++i) flights_[i - 1] = flights_[i];
    --flight_count_;
    reports_.exposure(record);
}

void CameraChannel::poll(Nanoseconds now) {
    expire(now);
    while (running_ && trigger_time() - decide_ahead <= now) decide(now);
}

Nanoseconds CameraChannel::next_wake() const {
    Nanoseconds wake = running_ ? trigger_time() - decide_ahead : INT64_MAX;
    if (flight_count_ > 0) wake = min(wake, deadline(flights_[0]));
    return wake;
}

}  // namespace versavis::firmware
