// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/pairing/pairing.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace versavis::pairing {

namespace {

constexpr double drift_gain = 0.05;
constexpr double largest_drift = 500e-6;
constexpr double difference_gain = 0.25;

}  // namespace

const char* to_string(State state) {
    switch (state) {
        case State::searching: return "searching";
        case State::checking: return "checking";
        case State::locked: return "locked";
    }
    return "unknown";
}

std::int64_t Pairing::frame_time_ns(const Arrival& arrival) const {
    return camera_clock_ ? arrival.camera_time.ns : arrival.arrived.ns;
}

bool Pairing::arrival_possible(const Arrival& arrival, const Exposure& exposure) const {
    const Duration after_end = arrival.arrived - exposure.end_on_host;
    return after_end >= limits_.earliest_arrival && after_end <= limits_.latest_arrival;
}

/// How many faults it takes that ids step by `id_step` between these triggers. Cameras count either every trigger or
/// only those that they took: both counts are right.
unsigned Pairing::step_faults(std::uint64_t id_step, std::uint64_t from_trigger, std::uint64_t to_trigger) const {
    if (to_trigger <= from_trigger || id_step == 0 || id_step > to_trigger - from_trigger) return faults_to_refute;
    std::uint64_t taken = 1;
    for (const Record& record : exposures_)
        if (record.exposure.trigger > from_trigger && record.exposure.trigger < to_trigger && record.exposure.exposed)
            ++taken;
    return static_cast<unsigned>(taken > id_step ? taken - id_step : 0);
}

/// Index of the first exposure that starts after `start`.
std::size_t Pairing::first_after(BoardTime start) const {
    const auto later = [](BoardTime time, const Record& record) { return time < record.exposure.start; };
    return static_cast<std::size_t>(std::upper_bound(exposures_.begin(), exposures_.end(), start, later) -
                                    exposures_.begin());
}

/// The exposure that starts within the tolerance of `start`; null when there is none.
const Pairing::Record* Pairing::near(BoardTime start) const {
    const std::size_t after = first_after(start);
    for (const std::size_t i : {after - 1, after})
        if (i < exposures_.size() && absolute(exposures_[i].exposure.start - start).ns <= tolerance_ns())
            return &exposures_[i];
    return nullptr;
}

/// True when an exposure whose record never came may have started about then.
bool Pairing::record_lost_near(BoardTime start) const {
    const std::size_t after = first_after(start);
    if (after == exposures_.size()) return false;
    if (after > 0) return exposures_[after].exposure.trigger > exposures_[after - 1].exposure.trigger + 1;
    return last_ && exposures_[after].exposure.trigger > last_->trigger + 1;
}

void Pairing::add(const Exposure& exposure) {
    if (!exposures_.empty()) {
        const Exposure& before = exposures_.back().exposure;
        // Records come in order; one that does not is of another life of the board, and belongs to no frame here.
        if (exposure.trigger <= before.trigger || exposure.start <= before.start)
            return outcome_.exposure_unpaired(exposure, EventReason::mismatch);
        smallest_gap_ns_ = std::min(smallest_gap_ns_, (exposure.start - before.start).ns);
    }
    exposures_.push_back({exposure});
    if (exposures_.size() > exposures_kept)
        drop_oldest_exposure(state_ == State::searching ? EventReason::unproved : EventReason::frame_missing);
    process();
}

void Pairing::add(const Arrival& arrival) {
    if (state_ == State::searching) {
        ++fruitless_;
        const bool has_clock = arrival.camera_time.ns != 0;
        if (arrivals_.empty()) camera_clock_ = has_clock;
        if (arrivals_.size() == std::max(limits_.frames_held, frames_for_proof)) drop_front(EventReason::unproved);
    } else if (arrivals_.size() == limits_.frames_held) {
        drop_front(EventReason::exposure_missing);
    }
    arrivals_.push_back(arrival);
    process();
}

void Pairing::process() {
    if (state_ == State::searching) search();
    while (state_ != State::searching && !arrivals_.empty() && match_front()) {
    }
}

/// What must have gone wrong if the frames' clock differs from the board's by `difference_ns`. None: it cannot be.
std::optional<Pairing::Alignment> Pairing::align(std::int64_t difference_ns) const {
    Alignment alignment;
    std::uint64_t last_trigger = 0;
    std::uint64_t last_id = 0;
    for (const Arrival& arrival : arrivals_) {
        const BoardTime start{frame_time_ns(arrival) - difference_ns};
        const Record* record = near(start);
        if (record == nullptr) {
            if (!record_lost_near(start)) return std::nullopt;  // no pulse was sent then
            alignment.unknown = true;
            continue;
        }
        if (!arrival_possible(arrival, record->exposure)) return std::nullopt;
        const std::uint64_t trigger = record->exposure.trigger;
        if (last_trigger != 0) alignment.faults += step_faults(arrival.block_id - last_id, last_trigger, trigger);
        last_trigger = trigger;
        last_id = arrival.block_id;
        alignment.triggers.push_back(trigger);
    }
    return alignment;
}

/// Differences of the clocks that bring some frame and some exposure together.
std::vector<std::int64_t> Pairing::candidate_differences() const {
    std::vector<std::int64_t> differences;
    for (const Arrival& arrival : arrivals_)
        for (const Record& record : exposures_)
            if (arrival_possible(arrival, record.exposure))
                differences.push_back(frame_time_ns(arrival) - record.exposure.start.ns);
    std::sort(differences.begin(), differences.end());
    const auto same = [this](std::int64_t a, std::int64_t b) { return b - a < tolerance_ns() / 2; };
    differences.erase(std::unique(differences.begin(), differences.end(), same), differences.end());
    return differences;
}

/// Locks when one alignment needs no fault to explain it, and each other one at least two.
void Pairing::search() {
    if (arrivals_.size() < frames_for_proof || exposures_.size() < frames_for_proof) return;
    // An exposure whose record is still on its way could explain the frames, too.
    const HostTime records_complete = exposures_.back().exposure.end_on_host + Duration{smallest_gap_ns_ / 4 * 3};
    if (arrivals_.back().arrived > records_complete) return;
    std::optional<Alignment> found;
    for (const std::int64_t difference : candidate_differences()) {
        auto alignment = align(difference);
        if (!alignment || alignment->faults >= faults_to_refute) continue;
        if (alignment->faults > 0 || alignment->unknown || found) return;
        found = std::move(alignment);
    }
    if (found) accept_alignment(found->triggers);
}

void Pairing::accept_alignment(const std::vector<std::uint64_t>& triggers) {
    state_ = State::locked;
    drift_ = 0;
    last_.reset();
    forget_exposures_before(triggers.front(), EventReason::unproved);
    outcome_.locked(exposures_.front().exposure);
    for (const std::uint64_t trigger : triggers) pair_front(trigger);
}

/// Decides the oldest waiting frame. False when it must wait for its exposure's record.
bool Pairing::match_front() {
    const Arrival arrival = arrivals_.front();
    const BoardTime start = expected_start(arrival);
    if (exposures_.empty() || (start - exposures_.back().exposure.start).ns > tolerance_ns()) return false;
    const Record* record = near(start);
    if (record != nullptr && !record->used && arrival_possible(arrival, record->exposure)) {
        decide_front(record->exposure);
    } else if (record == nullptr && record_lost_near(start)) {
        drop_front(EventReason::exposure_missing);
    } else {
        // Camera time leads nowhere: what was known of the camera's clock is void.
        slip(arrival);
        state_ = State::searching;
        fruitless_ = pattern_patience;
        drop_front(EventReason::mismatch);
    }
    return true;
}

/// The front frame is of this exposure by time; publish it only if the ids say the same.
void Pairing::decide_front(const Exposure& exposure) {
    const Arrival arrival = arrivals_.front();
    const bool agrees = step_faults(arrival.block_id - last_->block_id, last_->trigger, exposure.trigger) == 0;
    if (state_ == State::locked && agrees) return pair_front(exposure.trigger);
    if (state_ == State::locked) slip(arrival);
    agreeing_ = agrees ? agreeing_ + 1 : 0;
    if (agreeing_ >= frames_to_relock) {
        state_ = State::locked;
        outcome_.locked(exposure);
        return pair_front(exposure.trigger);
    }
    track(arrival, exposure);
    drop_front(EventReason::unproved);
}

BoardTime Pairing::expected_start(const Arrival& arrival) const {
    const BoardTime undrifted{frame_time_ns(arrival) - last_->difference_ns};
    return undrifted - Duration{std::llround(drift_ * static_cast<double>((undrifted - last_->start).ns))};
}

/// Once the pattern is over and every exposure of it is too old for a frame to come.
bool Pairing::wants_pattern(HostTime now) const {
    return state_ == State::searching && fruitless_ >= pattern_patience && now > next_pattern_;
}

void Pairing::pattern_requested(HostTime now) {
    next_pattern_ = now + limits_.pattern_duration + limits_.latest_arrival;
    fruitless_ = 0;
}

void Pairing::slip(const Arrival& arrival) {
    state_ = State::checking;
    agreeing_ = 0;
    outcome_.slipped(arrival);
}

/// Follows the difference of the two clocks and its rate.
void Pairing::track(const Arrival& arrival, const Exposure& exposure) {
    const std::int64_t difference = frame_time_ns(arrival) - exposure.start.ns;
    if (!last_) {
        last_ = Pair{difference, arrival.block_id, exposure.trigger, exposure.start};
        return;
    }
    const auto elapsed = static_cast<double>((exposure.start - last_->start).ns);
    const double surprise = static_cast<double>(difference - last_->difference_ns) - drift_ * elapsed;
    if (elapsed > 0) drift_ = std::clamp(drift_ + drift_gain * surprise / elapsed, -largest_drift, largest_drift);
    const double smoothed = drift_ * elapsed + difference_gain * surprise;
    last_ = Pair{last_->difference_ns + std::llround(smoothed), arrival.block_id, exposure.trigger, exposure.start};
}

void Pairing::pair_front(std::uint64_t trigger) {
    const Arrival arrival = arrivals_.front();
    arrivals_.pop_front();
    forget_exposures_before(trigger, EventReason::frame_missing);
    Record& record = exposures_.front();
    record.used = true;
    track(arrival, record.exposure);
    outcome_.paired(arrival, record.exposure);
}

void Pairing::drop_front(EventReason reason) {
    const Arrival arrival = arrivals_.front();
    arrivals_.pop_front();
    outcome_.frame_unpaired(arrival, reason);
}

/// Frames come in order: what precedes a paired trigger gets no frame any more.
void Pairing::forget_exposures_before(std::uint64_t trigger, EventReason reason) {
    while (!exposures_.empty() && exposures_.front().exposure.trigger < trigger) drop_oldest_exposure(reason);
}

void Pairing::drop_oldest_exposure(EventReason reason) {
    const Record record = exposures_.front();
    exposures_.pop_front();
    if (record.used) return;
    outcome_.exposure_unpaired(record.exposure, record.exposure.exposed ? reason : EventReason::trigger_ignored);
}

void Pairing::advance(HostTime now) {
    while (!arrivals_.empty() && state_ != State::searching &&
           now - arrivals_.front().arrived > limits_.exposure_wait)
        drop_front(EventReason::exposure_missing);
    // A search needs the exposures of several frames, however slow the camera.
    const std::size_t keep = state_ == State::searching ? exposures_kept / 4 : 0;
    while (exposures_.size() > keep &&
           now - exposures_.front().exposure.end_on_host > limits_.latest_arrival + limits_.exposure_wait)
        drop_oldest_exposure(state_ == State::searching ? EventReason::unproved : EventReason::frame_missing);
}

void Pairing::reset() {
    while (!arrivals_.empty()) drop_front(EventReason::reset);
    while (!exposures_.empty()) drop_oldest_exposure(EventReason::reset);
    state_ = State::searching;
    last_.reset();
    fruitless_ = 0;
    smallest_gap_ns_ = INT64_MAX;
}

}  // namespace versavis::pairing
