// SPDX-License-Identifier: BSD-3-Clause
#include "ptp_frames.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/rounding.hpp"
#include "settings/receive_mode.hpp"

namespace versavis::daemon {

namespace {

/// Of a reading of the clock: what it cannot tell by taking longer is in sigma. Half: sigma is
/// larger on usual networks. Twice: clocks may be off by twice as much, and sigma does not say so.
constexpr Duration usual_width = microseconds(200);

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

/// What is stamped longer before its arrival is stamped by another clock, not held up.
constexpr Duration oldest_frame = seconds(5);

/// A length that differs by more from what the camera was set to is another one: rounding of
/// exposures, as of rows, is less.
constexpr std::int64_t part_of_length = 20;
constexpr Duration least_difference = microseconds(50);

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
      latest_arrival_(from_us(configuration.latest_arrival_ms * 1e3) +
                      receive_lateness(configuration)),
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
    varies_ = exposure.ns == 0;
    settings_.add(exposure, since);
    if (exposure.ns != 0) exposure_ = exposure;
}

void PtpFrames::read_exposure(Duration exposure, HostTime at) {
    if (exposure.ns == 0) return;
    exposure_ = exposure;
    if (!varies_) settings_.add(exposure, at);
}

void PtpFrames::reconfigure(const CameraConfiguration& configuration) {
    refuse_all(EventReason::reset);
    PtpFrames fresh(configuration, most_held_);
    fresh.numbers_ = numbers_;
    fresh.newest_ = newest_;
    fresh.following_since_ = following_since_;
    fresh.exposure_ = exposure_;
    fresh.settings_ = settings_;
    fresh.varies_ = varies_;
    fresh.verdicts_ = std::move(verdicts_);
    if (fresh.configured_ == pairing::Instant::unknown) fresh.stamped_ = stamped_;
    *this = std::move(fresh);
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

/// When and for how long the camera exposed the frame, by its own account. Refused: that account
/// is none that it was set to.
EventReason PtpFrames::measure(const pairing::Arrival& arrival, const Account& length,
                               PtpExposure& exposure) const {
    std::optional<LengthRange> range;
    if (!varies_) range = settings_.at(arrival.arrived);
    const Duration said = length.event.ns != 0 ? length.event : length.chunk;
    exposure.length_known = said.ns != 0 || range;
    Duration doubt;
    if (said.ns != 0) {
        if (said.ns < 0 || said > longest_ + least_difference) return EventReason::wrong_exposure;
        exposure.length = said;
        if (range) {
            const Duration tolerance = std::max(said / part_of_length, least_difference);
            if (said + tolerance < range->shortest || said - tolerance > range->longest)
                return EventReason::wrong_exposure;
            if (length.event.ns == 0)
                doubt = std::max(absolute(said - range->shortest), absolute(said - range->longest));
        }
    } else if (range) {
        exposure.length = (range->shortest + range->longest) / 2;
        doubt = range->width() / 2;
    } else {
        exposure.length = exposure_;
        doubt = longest_;
    }
    exposure.start = arrival.camera_time - offset(stamped_, exposure.length);
    exposure.middle_sigma = doubt / 2;
    if (stamped_ == pairing::Instant::middle) exposure.middle_sigma = {};
    if (stamped_ == pairing::Instant::end) exposure.start_sigma = doubt;
    return EventReason::none;
}

/// Its exposure varies, and only the frame's data say how long this one was.
bool PtpFrames::length_may_lag(const Account& length, HostTime at) const {
    return length.event.ns == 0 && length.chunk.ns != 0 && (varies_ || !settings_.at(at));
}

/// What this frame says may be of the one before, which waited for it. If another was lost in
/// between, nobody knows.
void PtpFrames::learn_length(const pairing::Arrival& arrival, const Account& length) {
    if (held_.empty() || !held_.back().length_may_lag) return;
    Held& before = held_.back();
    const bool next = arrival.block_id == before.arrival.block_id + 1 && length.chunk.ns != 0;
    const Duration doubt = next ? absolute(length.chunk - before.exposure.length) : longest_;
    before.length_may_lag = false;
    if (stamped_ == pairing::Instant::end) before.exposure.start_sigma = doubt;
    if (stamped_ != pairing::Instant::middle)
        before.exposure.middle_sigma =
            rounded(std::hypot(before.exposure.middle_sigma.ns, doubt.ns / 2));
}

EventReason PtpFrames::judge(const pairing::Arrival& arrival, const clock::HostEstimate& stamped,
                             PtpExposure& exposure) {
    Pending* pending = match(exposure.start);
    // What is further off than a period is off what the clock shows, and not off some trigger.
    if (absolute(start_delay_) > period_) start_delay_ = stamped.time - arrival.arrived;
    const Duration age = arrival.arrived - stamped.time;
    if (pending == nullptr)
        return age > latest_arrival_ && age < oldest_frame ? EventReason::too_old
                                                           : EventReason::mismatch;
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
    if (stamped_ == pairing::Instant::unknown) {
        exposure.start_sigma = absolute(start_delay_);
        exposure.middle_sigma = rounded(std::hypot(start_delay_.ns, exposure.middle_sigma.ns));
    }
    return EventReason::none;
}

void PtpFrames::add(const pairing::Arrival& arrival, const Account& length,
                    const std::optional<clock::HostEstimate>& stamped) {
    learn_length(arrival, length);
    PtpExposure exposure;
    EventReason reason = measure(arrival, length, exposure);
    if (reason == EventReason::none)
        reason = stamped && following_since_ ? judge(arrival, *stamped, exposure)
                                             : EventReason::no_clock;
    misfits_ = reason == EventReason::mismatch ? misfits_ + 1 : 0;
    if (misfits_ >= misfits_to_unlock) unlock();
    if (reason != EventReason::none) return refuse(arrival, reason);
    if (held_.size() >= most_held_) {
        refuse(held_.front().arrival, EventReason::no_buffer);
        held_.pop_front();
    }
    if (varies_ && exposure.length_known) exposure_ = exposure.length;  // the next is about as long
    held_.push_back({arrival, exposure, length_may_lag(length, arrival.arrived)});
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
    newest_ = {};  // PTP's time may go on from anywhere
    refuse_all(EventReason::no_clock);
}

void PtpFrames::read_clock(const clock::ClockReading& reading, clock::Agreement agreement) {
    if (agreement == clock::Agreement::differs) return lose_clock();
    if (agreement != clock::Agreement::agrees) return;
    if (!following_since_) following_since_ = reading.shown;
    while (!held_.empty()) {
        Held& first = held_.front();
        if (reading.shown < first.exposure.start + first.exposure.length) return;
        if (first.length_may_lag) return;
        PtpExposure& exposure = first.exposure;
        if (reading.width() > usual_width) {
            const std::int64_t doubt_ns = (reading.width() / 2).ns;
            for (Duration* sigma : {&exposure.start_sigma, &exposure.middle_sigma})
                *sigma = rounded(std::hypot(sigma->ns, doubt_ns));
        }
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
    usual_delay_ = {};
    varies_ = true;
    stamped_ = configured_ != pairing::Instant::unknown ? configured_ : stamped;
    settings_.clear();
}

}  // namespace versavis::daemon
