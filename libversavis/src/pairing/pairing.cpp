// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/pairing/pairing.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace versavis::pairing {

namespace {

constexpr double drift_gain_per_s = 0.2;
constexpr double largest_drift_gain = 0.05;
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
    const Duration after_end = arrival.arrived - exposure.earliest_on_host;
    return after_end >= limits_.earliest_arrival && after_end <= limits_.latest_arrival;
}

/// How many faults it takes that ids step by `id_step` between these triggers. Cameras count either every
/// trigger or only those that they took: both counts are right. A trigger without record may have been taken
/// or not.
unsigned Pairing::step_faults(std::uint64_t id_step, const Record& from, const Record& to) {
    if (to.exposure.trigger <= from.exposure.trigger) return faults_to_refute;
    const std::uint64_t sent = to.exposure.trigger - from.exposure.trigger;
    if (id_step == 0 || id_step > sent) return faults_to_refute;
    const std::uint64_t unrecorded = sent - std::min(sent, to.recorded - from.recorded);
    const std::uint64_t silent = to.silent - from.silent - (to.exposure.exposed ? 0 : 1);
    const std::uint64_t taken = sent - std::min(sent - 1, unrecorded + silent);
    return taken > id_step ? static_cast<unsigned>(std::min<std::uint64_t>(taken - id_step, faults_to_refute))
                           : 0;
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
    return last_ && exposures_[after].exposure.trigger > last_->record.exposure.trigger + 1;
}

void Pairing::add(const Exposure& exposure) {
    if (!exposures_.empty()) {
        const Exposure& before = exposures_.back().exposure;
        // Records come in order; one that does not is of another life of the board, and belongs to no frame
        // here.
        if (exposure.trigger <= before.trigger || exposure.start <= before.start)
            return outcome_.exposure_unpaired(exposure, EventReason::mismatch);
        smallest_gap_ns_ = std::min(smallest_gap_ns_, (exposure.start - before.start).ns);
    }
    ++recorded_;
    if (!exposure.exposed) ++silent_;
    exposures_.push_back({exposure, false, recorded_, silent_});
    if (exposures_.size() > exposures_kept)
        drop_oldest_exposure(state_ == State::searching ? EventReason::unproved : EventReason::frame_missing);
    process();
}

void Pairing::add(const Arrival& arrival) {
    if (state_ == State::searching) {
        ++fruitless_;
        const bool has_clock = arrival.camera_time.ns != 0;
        while (has_clock != camera_clock_ && !arrivals_.empty()) drop_front(EventReason::unproved);
        camera_clock_ = has_clock;
        if (arrivals_.size() == std::max(limits_.frames_held, frames_for_proof))
            drop_front(EventReason::unproved);
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

/// What must have gone wrong if the frames' clock differs from the board's by `difference_ns`. None: it
/// cannot be.
std::optional<Pairing::Alignment> Pairing::align(std::int64_t difference_ns) const {
    Alignment alignment;
    const Record* last = nullptr;
    std::uint64_t last_id = 0;
    for (const Arrival& arrival : arrivals_) {
        const BoardTime start{frame_time_ns(arrival) - difference_ns};
        const Record* record = near(start);
        if (record == nullptr) {
            if (!record_lost_near(start)) return std::nullopt;  // no pulse was sent then
            alignment.unknown = true;
            continue;
        }
        if (record->used || !record->exposure.exposed || !arrival_possible(arrival, record->exposure))
            return std::nullopt;
        if (last != nullptr) alignment.faults += step_faults(arrival.block_id - last_id, *last, *record);
        last = record;
        last_id = arrival.block_id;
        alignment.triggers.push_back(record->exposure.trigger);
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
    const HostTime records_complete =
        exposures_.back().exposure.earliest_on_host + Duration{smallest_gap_ns_ / 4 * 3};
    if (arrivals_.back().arrived > records_complete) return;
    std::optional<Alignment> found;
    for (const std::int64_t difference : candidate_differences()) {
        auto alignment = align(difference);
        if (!alignment || alignment->faults >= faults_to_refute) continue;
        if (alignment->faults > 0 || alignment->unknown || found) return;
        found = std::move(alignment);
    }
    if (found && irregular(found->triggers.front(), found->triggers.back()))
        accept_alignment(found->triggers);
}

/// Regular triggers prove nothing: the true exposures may be those whose records are missing at either end.
bool Pairing::irregular(std::uint64_t first, std::uint64_t last) const {
    std::int64_t shortest = INT64_MAX;
    std::int64_t longest = 0;
    for (std::size_t i = 1; i < exposures_.size(); ++i) {
        const Exposure& before = exposures_[i - 1].exposure;
        const Exposure& after = exposures_[i].exposure;
        if (before.trigger < first || after.trigger > last || after.trigger != before.trigger + 1) continue;
        shortest = std::min(shortest, (after.start - before.start).ns);
        longest = std::max(longest, (after.start - before.start).ns);
    }
    return longest > shortest + 2 * tolerance_ns();
}

void Pairing::accept_alignment(const std::vector<std::uint64_t>& triggers) {
    state_ = State::locked;
    drift_ = 0;
    last_.reset();
    proved_.reset();
    forget_exposures_before(triggers.front(), EventReason::unproved);
    outcome_.locked(exposures_.front().exposure);
    for (const std::uint64_t trigger : triggers) pair_front(trigger);
}

/// Decides the oldest waiting frame. False when it must wait for its exposure's record.
bool Pairing::match_front() {
    const Arrival arrival = arrivals_.front();
    const BoardTime start = expected_start(arrival);
    if (exposures_.empty()) return false;
    const Exposure& newest = exposures_.back().exposure;
    if ((start - newest.start).ns > tolerance_ns()) {
        const HostTime on_host = newest.earliest_on_host + (start - newest.end);
        if (arrival.arrived - on_host >= limits_.earliest_arrival) return false;
        search_anew(arrival);  // it would have arrived before it was exposed
        return true;
    }
    const Record* record = near(start);
    if (record != nullptr && !record->exposure.exposed) {
        drop_front(EventReason::trigger_ignored);  // the exposure line says that there was none: one of them
                                                   // is wrong
    } else if (record != nullptr && !record->used && arrival_possible(arrival, record->exposure)) {
        decide_front(*record);
    } else if (record == nullptr && record_lost_near(start)) {
        drop_front(EventReason::exposure_missing);
    } else {
        search_anew(arrival);
    }
    return true;
}

/// What was known of the camera's clock, or of its ids, is void.
void Pairing::search_anew(const Arrival& arrival) {
    if (state_ == State::locked) slip(arrival);
    state_ = State::searching;
    fruitless_ = pattern_patience;
    drop_front(EventReason::mismatch);
}

/// The front frame is of this exposure by time; publish it only if the ids say the same. They are counted
/// from the newest frame that was published: counted from the one before, a clock that stepped by a period
/// agrees with itself.
void Pairing::decide_front(const Record& record) {
    const Arrival arrival = arrivals_.front();
    const bool agrees = step_faults(arrival.block_id - proved_->block_id, proved_->record, record) == 0;
    if (state_ == State::locked && agrees) return pair_front(record.exposure.trigger);
    if (state_ == State::locked) slip(arrival);
    agreeing_ = agrees ? agreeing_ + 1 : 0;
    disagreeing_ = agrees ? 0 : disagreeing_ + 1;
    if (disagreeing_ >= frames_to_relock) return search_anew(arrival);
    if (agreeing_ >= frames_to_relock) {
        state_ = State::locked;
        outcome_.locked(record.exposure);
        return pair_front(record.exposure.trigger);
    }
    track(arrival, record);
    drop_front(EventReason::unproved);
}

BoardTime Pairing::expected_start(const Arrival& arrival) const {
    const BoardTime undrifted{frame_time_ns(arrival) - last_->difference_ns};
    return undrifted - Duration{std::llround(
                           drift_ * static_cast<double>((undrifted - last_->record.exposure.start).ns))};
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
    agreeing_ = disagreeing_ = 0;
    outcome_.slipped(arrival);
}

/// Follows the difference of the two clocks and its rate.
void Pairing::track(const Arrival& arrival, const Record& record) {
    const Exposure& exposure = record.exposure;
    const std::int64_t difference = frame_time_ns(arrival) - exposure.start.ns;
    if (!last_) {
        last_ = Pair{difference, arrival.block_id, record};
        return;
    }
    const auto elapsed = static_cast<double>((exposure.start - last_->record.exposure.start).ns);
    const double surprise = static_cast<double>(difference - last_->difference_ns) - drift_ * elapsed;
    if (elapsed > 0 && camera_clock_) {
        const double gain = std::min(drift_gain_per_s * elapsed * 1e-9, largest_drift_gain);
        drift_ = std::clamp(drift_ + gain * surprise / elapsed, -largest_drift, largest_drift);
    }
    const double smoothed = drift_ * elapsed + difference_gain * surprise;
    last_ = Pair{last_->difference_ns + std::llround(smoothed), arrival.block_id, record};
}

void Pairing::pair_front(std::uint64_t trigger) {
    const Arrival arrival = arrivals_.front();
    arrivals_.pop_front();
    forget_exposures_before(trigger, EventReason::frame_missing);
    Record& record = exposures_.front();
    record.used = true;
    track(arrival, record);
    proved_ = last_;
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
    outcome_.exposure_unpaired(record.exposure,
                               record.exposure.exposed ? reason : EventReason::trigger_ignored);
}

void Pairing::advance(HostTime now) {
    while (!arrivals_.empty() && state_ != State::searching &&
           now - arrivals_.front().arrived > limits_.exposure_wait)
        drop_front(EventReason::exposure_missing);
    // A search needs the exposures of several frames, however slow the camera.
    const std::size_t keep = state_ == State::searching ? exposures_kept / 4 : 0;
    while (exposures_.size() > keep && now - exposures_.front().exposure.earliest_on_host >
                                           limits_.latest_arrival + limits_.exposure_wait)
        drop_oldest_exposure(state_ == State::searching ? EventReason::unproved : EventReason::frame_missing);
}

void Pairing::reset() {
    while (!arrivals_.empty()) drop_front(EventReason::reset);
    while (!exposures_.empty()) drop_oldest_exposure(EventReason::reset);
    state_ = State::searching;
    last_.reset();
    proved_.reset();
    fruitless_ = 0;
    smallest_gap_ns_ = INT64_MAX;
}

}  // namespace versavis::pairing
