// SPDX-License-Identifier: BSD-3-Clause
#include "ptp_frames.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/rounding.hpp"

namespace versavis::daemon {

namespace {

/// From a trigger to the stamp of its exposure, beyond the configured latency. Half: cameras with a
/// slow sensor need their latency configured. Twice: exposures of less than 0.8 ms hide that their
/// middle is stamped, and not their start.
constexpr Duration largest_start_delay = microseconds(200);

/// Longest time that a trigger is sent ahead.
constexpr Duration longest_trigger_lead = milliseconds(100);

/// Between a trigger and the sending of the next: many cameras keep only one.
constexpr std::int64_t parts_of_period = 10;

/// Share of a frame's delay by which later triggers are sent earlier. Half: jitter of single
/// exposures moves the others less. Twice: a camera meets its grid after eight frames.
constexpr std::int64_t parts_to_follow = 4;

/// Frames in a row whose stamps fit no trigger: which frame is of which must be shown anew.
constexpr int misfits_to_unlock = 3;

/// A frame that arrives so much before its exposure is over shows another clock; less is what the
/// clocks' sigma and the middle of a packet's way may be.
constexpr Duration arrival_margin = milliseconds(1);

/// From the exposure's start.
Duration offset(pairing::Instant instant, Duration length) {
    switch (instant) {
        case pairing::Instant::middle: return length / 2;
        case pairing::Instant::end: return length;
        default: return {};
    }
}

}  // namespace

PtpFrames::PtpFrames(const CameraConfiguration& configuration, std::size_t most_held)
    : grid_(configuration.rate_hz, from_us(configuration.phase_us)),
      period_(period_of(configuration)),
      latency_(from_us(configuration.latency_us)),
      longest_(from_us(configuration.max_exposure_us)),
      latest_arrival_(from_us(configuration.latest_arrival_ms * 1e3)),
      exposure_(from_us(configuration.exposure_us)),
      most_held_(most_held),
      settings_(period_ * (configuration.auto_exposure.delay_frames + 2)),
      configured_(configuration.stamp_instant),
      stamped_(configuration.stamp_instant) {}

Duration PtpFrames::lead() const {
    return std::min(longest_trigger_lead, period_ - period_ / parts_of_period);
}

PtpTrigger PtpFrames::next(CameraTime now) const {
    const Duration ahead = latency_ + usual_delay_ + exposure_ / 2;
    // One alone at first: its frame can be no other's.
    const Duration apart = locked_ ? period_ / 2 : latest_arrival_ + longest_;
    // Half of the lead is left for a late start of the thread, and the way to the camera.
    const CameraTime earliest = std::max(now + lead() / 2, newest_ + apart);
    const std::uint64_t k = grid_.first(earliest + ahead);
    return {numbers_ + 1, grid_.tick(k), grid_.point(k) - ahead, exposure_};
}

void PtpFrames::sent(const PtpTrigger& trigger, HostTime then) {
    numbers_ = trigger.number;
    newest_ = trigger.at;
    triggers_.push_back({trigger, then});
}

void PtpFrames::acknowledged(std::uint64_t trigger) {
    acknowledges_ = true;
    for (Pending& pending : triggers_)
        if (pending.trigger.number == trigger) pending.acknowledged = true;
}

void PtpFrames::set_exposure(Duration exposure, HostTime since) {
    settings_.add(exposure, since);
    if (exposure.ns != 0) exposure_ = exposure;
}

/// The trigger that an exposure with this start is of; null: none.
PtpFrames::Pending* PtpFrames::match(CameraTime start) {
    if (triggers_.empty()) return nullptr;
    const auto off = [&](const Pending& pending) {
        return start - (pending.trigger.at + latency_);
    };
    const auto nearest = std::min_element(
        triggers_.begin(), triggers_.end(),
        [&](const Pending& a, const Pending& b) { return absolute(off(a)) < absolute(off(b)); });
    start_delay_ = off(*nearest);
    return absolute(start_delay_) > largest_start_delay ? nullptr : &*nearest;
}

/// The camera did not get it, and would have said so.
bool PtpFrames::lost(const Pending& pending) const {
    return acknowledges_ && !pending.acknowledged && fitted_ &&
           pending.trigger.number > fitted_->trigger;
}

/// More frames than triggers that the camera has, since the one before.
bool PtpFrames::has_surplus_id(std::uint64_t block_id, std::uint64_t trigger) const {
    if (!fitted_) return false;
    std::uint64_t got = trigger - fitted_->trigger - fitted_->lost;
    for (const Pending& pending : triggers_)
        if (lost(pending) && pending.trigger.number < trigger) --got;
    return block_id - fitted_->block_id > got;
}

/// When and for how long the camera exposed the frame, by its own account.
PtpExposure PtpFrames::account(const pairing::Arrival& arrival, Duration length) {
    const auto range = settings_.at(arrival.arrived);
    PtpExposure exposure;
    exposure.length_known = length.ns != 0 || range;
    if (length.ns != 0) {
        // One that changed may be the one of the frame before.
        const Duration before = std::exchange(length_before_, length);
        exposure.length = length;
        if (before.ns != 0) exposure.middle_sigma = absolute(length - before) / 2;
    } else {
        exposure.length = range ? (range->shortest + range->longest) / 2 : exposure_;
        exposure.middle_sigma = range ? range->width() / 4 : longest_ / 2;
    }
    exposure.start = arrival.camera_time - offset(stamped_, exposure.length);
    return exposure;
}

EventReason PtpFrames::judge(const pairing::Arrival& arrival, const clock::HostEstimate& stamped,
                             PtpExposure& exposure) {
    Pending* pending = match(exposure.start);
    // What is further off than a period is off what the clock shows, and not off some trigger.
    if (absolute(start_delay_) > period_) start_delay_ = stamped.time - arrival.arrived;
    if (pending == nullptr) return EventReason::mismatch;
    exposure.start_delay = start_delay_;
    exposure.trigger = pending->trigger.number;
    exposure.tick = pending->trigger.tick;
    // Alone, only the newest can be meant.
    if (!locked_ && exposure.trigger != triggers_.back().trigger.number)
        return EventReason::mismatch;
    if (fitted_ && exposure.trigger <= fitted_->trigger) return EventReason::out_of_order;
    if (exposure.start < *following_since_) return EventReason::no_clock;
    const HostTime end = stamped.time + (exposure.start + exposure.length - arrival.camera_time);
    const Duration margin = stamped.bound + arrival_margin + exposure.middle_sigma;
    const Duration delay = arrival.arrived - end;
    if (delay + margin < Duration{}) return EventReason::not_yet;
    if (delay - margin > latest_arrival_) return EventReason::too_old;
    // A stamp of the exposure before: one frame too many, and later than usual by a period.
    const bool late = usual_arrival_ && delay > *usual_arrival_ + period_ / 2;
    if (late && has_surplus_id(arrival.block_id, exposure.trigger)) return EventReason::mismatch;
    fitted_ = {arrival.block_id, exposure.trigger, 0};
    usual_arrival_ = std::min(
        delay,
        usual_arrival_ ? *usual_arrival_ + (delay - *usual_arrival_) / parts_to_follow : delay);
    pending->answered = true;
    // What nobody knows to be the start may be as much later.
    if (stamped_ == pairing::Instant::unknown)
        exposure.middle_sigma = rounded(std::hypot(start_delay_.ns, exposure.middle_sigma.ns));
    return EventReason::none;
}

void PtpFrames::add(const pairing::Arrival& arrival, Duration length,
                    const std::optional<clock::HostEstimate>& stamped) {
    PtpExposure exposure = account(arrival, length);
    const bool clock_known = stamped && following_since_;
    const EventReason reason =
        clock_known ? judge(arrival, *stamped, exposure) : EventReason::no_clock;
    misfits_ = reason == EventReason::mismatch ? misfits_ + 1 : 0;
    if (misfits_ >= misfits_to_unlock) unlock();
    if (reason != EventReason::none) return refuse(arrival, reason);
    if (held_.size() >= most_held_) {
        refuse(held_.front().arrival, EventReason::no_buffer);
        held_.pop_front();
    }
    held_.push_back({arrival, exposure});
}

void PtpFrames::refuse(const pairing::Arrival& arrival, EventReason reason) {
    proved_ = false;
    verdicts_.push_back({arrival, std::nullopt, reason});
}

void PtpFrames::unlock() {
    locked_ = false;
    fitted_.reset();
    usual_arrival_.reset();
}

void PtpFrames::refuse_all(EventReason reason) {
    for (const Held& held : held_) refuse(held.arrival, reason);
    held_.clear();
}

void PtpFrames::lose_clock() {
    following_since_.reset();
    refuse_all(EventReason::no_clock);
}

void PtpFrames::read_clock(const clock::ClockReading& reading, clock::Agreement agreement) {
    if (agreement == clock::Agreement::differs) return lose_clock();
    if (agreement != clock::Agreement::agrees) return;
    if (!following_since_) following_since_ = reading.shown;
    while (!held_.empty()) {
        const Held& first = held_.front();
        if (reading.shown < first.exposure.start + first.exposure.length) return;
        usual_delay_ = usual_delay_ + (first.exposure.start_delay - usual_delay_) / parts_to_follow;
        proved_ = locked_ = true;
        verdicts_.push_back({first.arrival, first.exposure, EventReason::none});
        held_.pop_front();
    }
}

void PtpFrames::advance(HostTime now) {
    while (!held_.empty() && now - held_.front().arrival.arrived > latest_arrival_) {
        refuse(held_.front().arrival, EventReason::no_clock);
        held_.pop_front();
    }
    while (!triggers_.empty() && now - triggers_.front().at > latest_arrival_ + longest_) {
        if (!triggers_.front().answered) missed_.push_back(triggers_.front().trigger);
        if (lost(triggers_.front())) ++fitted_->lost;
        triggers_.pop_front();
    }
}

void PtpFrames::restart(pairing::Instant stamped) {
    refuse_all(EventReason::reset);
    triggers_.clear();
    following_since_.reset();
    unlock();
    acknowledges_ = false;
    length_before_ = usual_delay_ = {};
    stamped_ = configured_ != pairing::Instant::unknown ? configured_ : stamped;
    settings_.clear();
}

}  // namespace versavis::daemon
