// SPDX-License-Identifier: BSD-3-Clause
#include "exposure_tracker.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds certain_latency = 200'000;  // a shorter latency may vary by as much as itself

}  // namespace

void ExposureTracker::configure(const wire::CameraConfiguration& configuration,
                                Nanoseconds patience) {
    configuration_ = configuration;
    patience_ = patience;
    period_ = configuration.rate_uhz == 0 ? never : 1'000'000'000'000'000 / configuration.rate_uhz;
}

void ExposureTracker::add(const wire::Exposure& record, Nanoseconds expected) {
    pending_[count_++] = {record, expected};
}

void ExposureTracker::moved(Nanoseconds asked, Nanoseconds left, bool late) {
    for (std::size_t i = 0; i < count_; ++i) {
        if (pending_[i].record.trigger_ns != asked) continue;
        pending_[i].record.trigger_ns = left;
        if (late) pending_[i].record.flags |= wire::exposure_late;
    }
}

ExposureTracker::Completed ExposureTracker::edge(Nanoseconds at, bool exposing) {
    expire(at);
    if (!exposing) return end_edge(at);
    start_edge(at);
    return {};
}

/// The edge belongs to the newest trigger that can have caused it: the camera ignored the older
/// ones that still wait for a start.
void ExposureTracker::start_edge(Nanoseconds at) {
    const Nanoseconds latency = configuration_.latency_ns;
    const Nanoseconds soonest = latency > certain_latency ? latency / 2 : 0;
    std::size_t found = count_;
    for (std::size_t i = 0; i < count_; ++i)
        if (pending_[i].record.trigger_ns + soonest <= at && !started(pending_[i])) found = i;
    if (found == count_) {
        edges_lost();  // if the line rose twice, an end in between was missed
        return reports_.event(wire::BoardEventKind::stray_edge, camera_, at, 1);
    }
    // The line has only one level: whatever still waits before this trigger was ignored, or its end
    // edge was lost.
    for (; found > 0; --found)
        finish_first(started(pending_[0]) ? wire::exposure_no_end : wire::exposure_no_start);
    pending_[0].record.start_ns = at;
}

ExposureTracker::Completed ExposureTracker::end_edge(Nanoseconds at) {
    if (count_ == 0 || !started(pending_[0])) {
        reports_.event(wire::BoardEventKind::stray_edge, camera_, at, 0);
        return {};
    }
    wire::Exposure& record = pending_[0].record;
    record.end_ns = at;
    const Completed completed{record.trigger, at - record.start_ns};
    const bool overlong = completed.duration > period_;
    finish_first(static_cast<std::uint16_t>(
        overlong ? wire::exposure_measured | wire::exposure_overlong : wire::exposure_measured));
    return completed;
}

void ExposureTracker::edges_lost() {
    if (count_ > 0 && started(pending_[0])) finish_first(wire::exposure_no_end);
}

Nanoseconds ExposureTracker::busy_until(Nanoseconds settled) const {
    if (count_ == 0) return last_end_;
    const PendingExposure& first = pending_[0];
    if (started(first) && first.record.start_ns + first.expected < settled)
        return never / 2;  // overdue: it may last any length of time
    const PendingExposure& newest = pending_[count_ - 1];
    const Nanoseconds start = started(newest)
                                  ? newest.record.start_ns
                                  : newest.record.trigger_ns + configuration_.latency_ns;
    return start + newest.expected;
}

std::uint64_t ExposureTracker::tick_at(Nanoseconds at) const {
    std::uint64_t tick = last_tick_;
    for (std::size_t i = 0; i < count_; ++i)
        if (pending_[i].record.trigger_ns <= at) tick = pending_[i].record.tick;
    return tick;
}

Nanoseconds ExposureTracker::deadline(const PendingExposure& exposure) const {
    if (has(wire::camera_no_strobe))
        return exposure.record.trigger_ns + configuration_.latency_ns + exposure.expected;
    if (started(exposure)) return exposure.record.start_ns + configuration_.max_exposure_ns;
    return exposure.record.trigger_ns + configuration_.latency_ns + patience_;
}

Nanoseconds ExposureTracker::next_deadline() const {
    return count_ == 0 ? never : deadline(pending_[0]);
}

void ExposureTracker::expire(Nanoseconds settled) {
    while (count_ > 0 && deadline(pending_[0]) <= settled) {
        if (has(wire::camera_no_strobe)) {
            predict_edges(pending_[0]);
            finish_first(wire::exposure_predicted);
        } else if (started(pending_[0])) {
            const Nanoseconds given_up = deadline(pending_[0]);
            finish_first(wire::exposure_no_end | wire::exposure_overlong);
            last_end_ = given_up;
        } else {
            finish_first(wire::exposure_no_start);
        }
    }
}

void ExposureTracker::give_up() {
    while (count_ > 0) {
        if (has(wire::camera_no_strobe)) predict_edges(pending_[0]);
        finish_first(has(wire::camera_no_strobe) ? wire::exposure_predicted
                     : started(pending_[0])      ? wire::exposure_no_end
                                                 : wire::exposure_no_start);
    }
}

void ExposureTracker::predict_edges(PendingExposure& exposure) const {
    exposure.record.start_ns = exposure.record.trigger_ns + configuration_.latency_ns;
    exposure.record.end_ns = exposure.record.start_ns + exposure.expected;
}

void ExposureTracker::finish_first(std::uint16_t flags) {
    wire::Exposure record = pending_[0].record;
    record.flags = static_cast<std::uint16_t>(record.flags | flags);
    if (record.end_ns != wire::no_time) last_end_ = record.end_ns;
    last_tick_ = record.tick;
    --count_;
    for (std::size_t i = 0; i < count_; ++i) pending_[i] = pending_[i + 1];
    reports_.exposure(record);
}

}  // namespace versavis::firmware
