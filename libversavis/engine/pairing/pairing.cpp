// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/pairing.hpp"

#include <algorithm>
#include <cstdlib>

namespace versavis::pairing {

namespace {

constexpr std::size_t frames_in_search = 12;
constexpr int frames_to_relock = 3;
constexpr int frames_to_give_up = 5;
// Lateness passes. Without a camera's clock nothing else can tell a late frame from a missed
// trigger.
constexpr Duration shortest_check = milliseconds(100);
constexpr Duration shortest_check_by_arrival = milliseconds(300);
constexpr std::uint64_t ids_back = 16;
constexpr int patterns_before_slow = 2;
constexpr int starts_in_a_row = 3;
constexpr int longest_patience = 10;
constexpr Duration slow_duration = seconds(6);
constexpr Duration search_patience = seconds(10);
constexpr std::int64_t step_tolerance_ns = 30'000;
constexpr std::int64_t step_tolerance_part = 2'000;  // 500 ppm

}  // namespace

const char* to_string(State state) {
    switch (state) {
        case State::searching: return "searching";
        case State::checking: return "checking";
        case State::locked: return "locked";
    }
    return "unknown";
}

Pairing::Pairing(const Limits& limits, Outcome& outcome)
    : limits_(limits),
      outcome_(outcome),
      timeline_(limits.camera_clock ? Timeline::camera : Timeline::arrival),
      exposures_(limits.period) {}

std::int64_t Pairing::frame_ns(const Arrival& arrival) const {
    return timeline_ == Timeline::camera ? arrival.camera_time.ns : arrival.arrived.ns;
}

std::int64_t Pairing::expected_instant_ns(const Arrival& arrival) const {
    const Relation& relation = timeline_ == Timeline::camera ? clock_ : latency_;
    return relation.expected_instant_ns(frame_ns(arrival));
}

void Pairing::add(const Exposure& exposure) {
    if (!exposures_.add(exposure))
        return outcome_.exposure_unpaired(exposure, EventReason::mismatch);
    if (exposures_.size() > exposures_kept) drop_oldest_exposure(EventReason::frame_missing);
    process();
}

void Pairing::add(const Arrival& arrival) {
    last_arrival_ = arrival.arrived;
    ++frames_since_start_;
    if (state_ == State::searching) {
        const bool clock = limits_.camera_clock && arrival.camera_time.ns != 0;
        const Timeline timeline = clock ? Timeline::camera : Timeline::arrival;
        while (timeline != timeline_ && !arrivals_.empty()) drop_front(EventReason::unproved);
        timeline_ = timeline;
    }
    if (arrivals_.size() >= limits_.frames_held) expire_front();
    arrivals_.push_back(arrival);
    process();
}

void Pairing::add(const Shortfall& shortfall) { note(shortfall); }

void Pairing::note(const Shortfall& shortfall) {
    shortfalls_.push_back(shortfall);
    if (shortfalls_.size() > shortfalls_kept) shortfalls_.pop_front();
}

void Pairing::process() {
    if (state_ == State::searching) search();
    while (state_ != State::searching && !arrivals_.empty() &&
           (state_ == State::locked ? decide_locked() : decide_checking())) {
    }
}

/// An exposure whose record is still on its way could explain the frame, too.
bool Pairing::records_complete(const Arrival& arrival) const {
    if (exposures_.empty()) return false;
    const Duration until = exposures_.back().exposure.earliest_on_host - arrival.arrived;
    return until.ns > -exposures_.smallest_gap_ns() / 4 * 3;
}

/// The oldest frames may be of another life of camera or board: they need no place in the
/// alignment.
void Pairing::search() {
    const std::size_t enough =
        frames_for_proof(start_ == Start::slow ? Timeline::arrival : timeline_);
    if (arrivals_.size() < enough || !records_complete(arrivals_.back())) return;
    const std::size_t oldest = arrivals_.size() - std::min(arrivals_.size(), frames_in_search);
    for (std::size_t first = oldest; first + enough <= arrivals_.size(); ++first) {
        const std::vector<Arrival> frames(arrivals_.begin() + static_cast<std::ptrdiff_t>(first),
                                          arrivals_.end());
        const auto triggers = find_alignment(frames);
        if (triggers.empty()) continue;
        for (std::size_t i = 0; i < first; ++i) drop_front(EventReason::unproved);
        return accept(triggers);
    }
}

std::vector<std::uint64_t> Pairing::find_alignment(const std::vector<Arrival>& frames) const {
    auto found = align(frames, exposures_, timeline_, limits_);
    // Slow triggers are regular, but so far apart that arrivals alone prove it.
    if (found.empty() && start_ == Start::slow)
        found = align(frames, exposures_, Timeline::arrival, limits_);
    return found;
}

void Pairing::accept(const std::vector<std::uint64_t>& triggers) {
    const std::uint64_t first =
        *std::find_if(triggers.begin(), triggers.end(), [](auto t) { return t != 0; });
    forget_exposures_before(first);
    state_ = State::locked;
    clock_ = Relation(true);
    latency_ = Relation(false);
    proved_.reset();
    shortest_delay_ns_ = INT64_MAX;
    fruitless_starts_ = 0;
    start_ends_ =
        std::min(start_ends_, last_arrival_ + limits_.pattern_duration + limits_.latest_arrival);
    outcome_.locked(exposures_.front().exposure);
    for (const std::uint64_t trigger : triggers)
        if (trigger != 0)
            pair_front(trigger);
        else
            drop_front(EventReason::unproved);
}

/// False while the record of the exposure at `instant_ns` may come: unless the frame would have
/// arrived before it was exposed.
bool Pairing::may_still_be_recorded(const Arrival& arrival, std::int64_t instant_ns) const {
    const Record& newest = exposures_.back();
    if (instant_ns - newest.instant_ns(timeline_) <= loose_ns()) return false;
    if (timeline_ == Timeline::arrival) return true;
    const HostTime on_host =
        newest.exposure.earliest_on_host + Duration{instant_ns - newest.exposure.end.ns};
    return arrival.arrived - on_host >= limits_.earliest_arrival;
}

/// This frame, or a newer one, was published before: ids and time agree on that.
bool Pairing::out_of_order(const Arrival& arrival) const {
    const std::uint64_t newest = proved_->arrival.block_id;
    if (arrival.block_id > newest || arrival.block_id + ids_back < newest) return false;
    if (timeline_ == Timeline::arrival) return true;
    const std::int64_t behind =
        proved_->record.instant_ns(timeline_) - expected_instant_ns(arrival);
    return behind >= -loose_ns() && behind <= limits_.latest_arrival.ns;
}

bool Pairing::ids_agree(const Arrival& arrival, const Record& record) const {
    return step_faults(arrival.block_id - proved_->arrival.block_id, proved_->record, record) == 0;
}

bool Pairing::verified(const Arrival& arrival, const Record& record) const {
    return !record.used && record.exposure.exposed &&
           arrival_possible(limits_, arrival, record.exposure) && ids_agree(arrival, record) &&
           !length_contradicts(arrival, record.exposure) &&
           (timeline_ == Timeline::camera || ids_exact(arrival, record));
}

/// Were a trigger left out of the count, a frame of the exposure before would do as well, only
/// late.
bool Pairing::ids_exact(const Arrival& arrival, const Record& record) const {
    return arrival.block_id - proved_->arrival.block_id ==
           record.exposure.trigger - proved_->record.exposure.trigger;
}

/// Decides the oldest waiting frame. False when it must wait for its exposure's record.
bool Pairing::decide_locked() {
    const Arrival arrival = arrivals_.front();
    if (exposures_.empty()) return false;
    const std::int64_t instant = expected_instant_ns(arrival);
    if (may_still_be_recorded(arrival, instant)) return false;
    const Record* record = exposures_.near(timeline_, instant, loose_ns());
    if (out_of_order(arrival)) {
        drop_front(EventReason::out_of_order);
    } else if (record == nullptr && instant > proved_->record.instant_ns(timeline_) &&
               exposures_.lost_near(timeline_, instant, proved_->record.exposure.trigger)) {
        drop_front(EventReason::exposure_missing);
    } else if (record != nullptr && !record->exposure.exposed) {
        drop_front(EventReason::trigger_ignored);  // the exposure line says that there was none
    } else if (record != nullptr && verified(arrival, *record) && !early(arrival, *record) &&
               (timeline_ == Timeline::camera || latency_trusted())) {
        waits_for_witness_ = needs_witness(arrival, *record) && !has_witness();
        if (waits_for_witness_) return false;
        pair_front(record->exposure.trigger);
    } else {
        slip(arrival);
    }
    return true;
}

/// Against when a frame of this exposure usually arrives.
std::int64_t Pairing::lateness_ns(const Arrival& arrival, const Record& record) const {
    return latency_.expected_instant_ns(arrival.arrived.ns) - record.exposure.end_on_host.ns;
}

/// A frame may be late, but not earlier than the quickest ever was.
bool Pairing::early(const Arrival& arrival, const Record& record) const {
    const std::int64_t delay = (arrival.arrived - record.exposure.end_on_host).ns;
    return 3 * (delay - shortest_delay_ns_) < -2 * exposures_.smallest_gap_ns();
}

/// Frames that come later and later wait for each other somewhere. When one of them is dropped, the
/// others come earlier by a period, and seem to be of the trigger before, as they do by their ids
/// if those do not count the dropped one.
bool Pairing::latency_trusted() const {
    const std::int64_t gap = exposures_.smallest_gap_ns();
    return 6 * latency_.deviation_ns() <= gap &&
           4 * (latency_.difference_ns() - shortest_delay_ns_) < 3 * gap;
}

bool Pairing::punctual(const Arrival& arrival, const Record& record) const {
    return 3 * std::abs(lateness_ns(arrival, record)) < exposures_.smallest_gap_ns();
}

bool Pairing::late(const Arrival& arrival, const Record& record) const {
    return 3 * lateness_ns(arrival, record) > 2 * exposures_.smallest_gap_ns();
}

/// Where ids leave a choice, because a trigger may have been ignored, a camera clock that steps
/// back by as many periods lets both agree on a wrong exposure. Only the arrival, which seems late,
/// speaks against it.
bool Pairing::needs_witness(const Arrival& arrival, const Record& record) const {
    const bool all_taken = record.exposure.kind != StampKind::trigger_edge &&
                           record.exposure.trigger > proved_->record.exposure.trigger &&
                           perhaps_not_taken(proved_->record, record) == 0;
    return timeline_ == Timeline::camera && !all_taken &&
           (late(arrival, record) || !latency_trusted());
}

/// A later frame for which all three kinds of evidence agree: then the two did not step before it
/// either.
bool Pairing::has_witness() const {
    return std::any_of(arrivals_.begin() + 1, arrivals_.end(), [this](const Arrival& later) {
        const Record* record = by_clock(later, loose_ns());
        return record != nullptr && latency_trusted() && verified(later, *record) &&
               punctual(later, *record);
    });
}

void Pairing::slip(const Arrival& arrival) {
    state_ = State::checking;
    suspicions_ = {};
    undecided_ = 0;
    waits_for_witness_ = false;
    slipped_ = arrival.arrived;
    outcome_.slipped(arrival);
}

const Record* Pairing::by_clock(const Arrival& arrival, std::int64_t tolerance_ns) const {
    if (timeline_ != Timeline::camera || arrival.camera_time.ns == 0) return nullptr;
    return exposures_.near(Timeline::camera, clock_.expected_instant_ns(arrival.camera_time.ns),
                           tolerance_ns);
}

/// None as well when frames come too irregularly to tell.
const Record* Pairing::by_latency(const Arrival& arrival) const {
    if (!latency_trusted()) return nullptr;
    return exposures_.near(Timeline::arrival, latency_.expected_instant_ns(arrival.arrived.ns),
                           exposures_.smallest_gap_ns() / 3);
}

/// The only exposure that ids and arrival allow.
const Record* Pairing::by_ids(const Arrival& arrival) const {
    const Record* found = nullptr;
    for (std::size_t i = 0; i < exposures_.size(); ++i) {
        const Record& record = exposures_[i];
        if (!verified(arrival, record)) continue;
        if (found != nullptr) return nullptr;
        found = &record;
    }
    return found;
}

/// Which kind of evidence stepped, if the others agree on frame after frame?
bool Pairing::decide_checking() {
    const Arrival arrival = arrivals_.front();
    if (!records_complete(arrival)) return false;
    if (out_of_order(arrival)) {
        drop_front(EventReason::out_of_order);
        return true;
    }
    const Record* late = by_latency(arrival);
    const Record* likely = timeline_ == Timeline::camera ? by_clock(arrival, loose_ns()) : late;
    if (likely != nullptr && likely == late && verified(arrival, *likely)) {
        relock(*likely);  // all agree: nothing stepped after all
        return true;
    }
    const Record* clocked =
        by_clock(arrival, std::min(loose_ns(), clock_.tolerance_ns(expected_instant_ns(arrival))));
    const bool free = clocked != nullptr && !clocked->used && clocked->exposure.exposed;
    // A clock that steps does not hit another exposure to some microseconds. When it fits so well,
    // it is ids and arrivals that have stepped together.
    const bool may_have_stepped = timeline_ == Timeline::camera && clocked == nullptr;
    const Record* counted = may_have_stepped ? by_ids(arrival) : nullptr;
    if (!suspect(Stepped::ids, arrival, free && clocked == late ? clocked : nullptr) &&
        !suspect(Stepped::clock, arrival, counted == late ? counted : nullptr))
        give_up_front();
    return true;
}

/// True when it is certain by now: then the frame was published.
bool Pairing::suspect(Stepped kind, const Arrival& arrival, const Record* record) {
    Suspicion& suspicion = suspicions_[static_cast<std::size_t>(kind)];
    if (record == nullptr) {
        suspicion.frames = 0;
        return false;
    }
    const Pair now{arrival, *record};
    suspicion.frames =
        suspicion.frames > 0 && consistent(kind, suspicion.last, now) ? suspicion.frames + 1 : 1;
    suspicion.last = now;
    if (suspicion.frames < frames_to_relock) return false;
    if (kind == Stepped::clock) clock_.move(arrival.camera_time.ns, record->exposure.start.ns);
    relock(*record);
    return true;
}

void Pairing::relock(const Record& record) {
    state_ = State::locked;
    outcome_.locked(record.exposure);
    pair_front(record.exposure.trigger);
}

/// What stepped must be steady since.
bool Pairing::consistent(Stepped kind, const Pair& before, const Pair& now) {
    if (step_faults(now.arrival.block_id - before.arrival.block_id, before.record, now.record) != 0)
        return false;
    if (kind != Stepped::clock) return true;
    const std::int64_t elapsed = (now.record.exposure.start - before.record.exposure.start).ns;
    const std::int64_t step = (now.arrival.camera_time - before.arrival.camera_time).ns;
    return std::abs(step - elapsed) <= step_tolerance_ns + elapsed / step_tolerance_part;
}

void Pairing::give_up_front() {
    const Duration since = arrivals_.front().arrived - slipped_;
    const Duration shortest =
        timeline_ == Timeline::camera ? shortest_check : shortest_check_by_arrival;
    if (++undecided_ < frames_to_give_up || since < shortest)
        return drop_front(EventReason::unproved);
    drop_front(EventReason::mismatch);
    state_ = State::searching;
    frames_since_start_ = static_cast<int>(frames_for_proof(timeline_));
}

std::optional<Start> Pairing::wanted_start(HostTime now) const {
    if (state_ == State::locked && start_ == Start::slow) return Start::steady;
    if (state_ != State::searching) return std::nullopt;
    const bool futile = timeline_ == Timeline::arrival && start_ == Start::pattern;
    if (!futile && now <= start_ends_) return std::nullopt;
    if (frames_since_start_ < static_cast<int>(frames_for_proof(timeline_))) return std::nullopt;
    const bool slow = timeline_ == Timeline::arrival ||
                      fruitless_starts_ % (patterns_before_slow + 1) == patterns_before_slow;
    return slow ? Start::slow : Start::pattern;
}

void Pairing::start_requested(Start start, HostTime now) {
    start_ = start;
    if (start == Start::steady) return;
    ++fruitless_starts_;
    frames_since_start_ = 0;
    // A start costs triggers: what does not help is asked for less and less often.
    const int patience = std::clamp(fruitless_starts_ - starts_in_a_row, 1, longest_patience);
    const Duration duration = start == Start::slow ? slow_duration : limits_.pattern_duration;
    start_ends_ = now + (duration + limits_.latest_arrival) * patience;
}

void Pairing::pair_front(std::uint64_t trigger) {
    const Arrival arrival = arrivals_.front();
    arrivals_.pop_front();
    forget_exposures_before(trigger);
    Record& record = *exposures_.find(trigger);
    record.used = true;
    if (arrival.camera_time.ns != 0) clock_.track(arrival.camera_time.ns, record.exposure.start.ns);
    shortest_delay_ns_ =
        std::min(shortest_delay_ns_, (arrival.arrived - record.exposure.end_on_host).ns);
    if (!latency_.known() || punctual(arrival, record))
        latency_.track(arrival.arrived.ns, record.exposure.end_on_host.ns);
    proved_ = Pair{arrival, record};
    outcome_.paired(arrival, record.exposure);
}

/// It has waited too long.
void Pairing::expire_front() {
    if (state_ == State::locked && waits_for_witness_) {  // frames stay late
        slip(arrivals_.front());
        waits_for_witness_ = false;
    }
    drop_front(state_ == State::locked ? EventReason::exposure_missing : EventReason::unproved);
}

void Pairing::drop_front(EventReason reason) {
    const Arrival arrival = arrivals_.front();
    arrivals_.pop_front();
    if (reason != EventReason::out_of_order) note({arrival.block_id, reason});
    const Record* guess = nullptr;
    if (proved_ && state_ != State::searching)
        guess = exposures_.near(timeline_, expected_instant_ns(arrival), loose_ns());
    outcome_.frame_unpaired(arrival, reason, guess == nullptr ? nullptr : &guess->exposure);
}

/// Frames come in order: what precedes a paired trigger gets no frame any more.
void Pairing::forget_exposures_before(std::uint64_t trigger) {
    while (!exposures_.empty() && exposures_.front().exposure.trigger < trigger)
        drop_oldest_exposure(EventReason::frame_missing);
}

void Pairing::drop_oldest_exposure(EventReason reason) {
    const Record record = exposures_.pop_front();
    if (record.used) return;
    outcome_.exposure_unpaired(record.exposure, explanation(record, reason));
}

/// Why a trigger has no frame: what is known of the frame whose number it should have.
EventReason Pairing::explanation(const Record& record, EventReason otherwise) {
    if (!record.exposure.exposed) return EventReason::trigger_ignored;
    if (otherwise == EventReason::reset) return otherwise;
    if (!proved_ || state_ == State::searching) return EventReason::unproved;
    const std::uint64_t sent = record.exposure.trigger - proved_->record.exposure.trigger;
    const std::uint64_t silent = record.silent - proved_->record.silent;
    const std::uint64_t last = proved_->arrival.block_id + sent;
    const auto known =
        std::find_if(shortfalls_.begin(), shortfalls_.end(), [&](const Shortfall& shortfall) {
            return shortfall.block_id == 0 ||
                   (shortfall.block_id <= last && shortfall.block_id + silent >= last);
        });
    if (known == shortfalls_.end()) return otherwise;
    const EventReason reason = known->reason;
    shortfalls_.erase(known);
    return reason;
}

bool Pairing::arrival_expired(HostTime now) const {
    const Duration patience =
        state_ == State::searching ? search_patience + limits_.period * 10 : limits_.exposure_wait;
    return !arrivals_.empty() && now - arrivals_.front().arrived > patience;
}

/// A search needs the exposures of several frames, however slow the camera.
bool Pairing::exposure_expired(HostTime now) const {
    const std::size_t keep = state_ == State::searching ? exposures_kept / 4 : 0;
    return exposures_.size() > keep && now - exposures_.front().exposure.earliest_on_host >
                                           limits_.latest_arrival + limits_.exposure_wait;
}

bool Pairing::due(HostTime now) const { return arrival_expired(now) || exposure_expired(now); }

void Pairing::advance(HostTime now) {
    while (arrival_expired(now)) expire_front();
    const bool silent = now - last_arrival_ > limits_.latest_arrival + limits_.exposure_wait;
    while (exposure_expired(now))
        drop_oldest_exposure(silent ? EventReason::camera_silent : EventReason::frame_missing);
}

void Pairing::set_limits(const Limits& limits) {
    limits_ = limits;
    timeline_ = limits.camera_clock ? Timeline::camera : Timeline::arrival;
    exposures_ = ExposureLog(limits.period);
}

void Pairing::reset() {
    while (!arrivals_.empty()) drop_front(EventReason::reset);
    while (!exposures_.empty()) drop_oldest_exposure(EventReason::reset);
    state_ = State::searching;
    exposures_ = ExposureLog(limits_.period);
    shortfalls_.clear();
    proved_.reset();
    waits_for_witness_ = false;
    start_.reset();
    fruitless_starts_ = 0;
    frames_since_start_ = 0;
    start_ends_ = {};
}

}  // namespace versavis::pairing
