// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/pairing.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace versavis::pairing {

namespace {

// Newest frames that a search tries to align: a whole pattern; the oldest may be of another life of
// the camera. At half a fault within a start costs another pattern; at twice each search takes
// longer.
constexpr std::size_t frames_in_search = 20;

// Fewest exposures remembered. At half a fast camera that waits for records loses some; at twice a
// search looks at more that are too old to matter.
constexpr std::size_t fewest_exposures = 128;

// Most exposures remembered, however late frames may come. At half a camera of 1 kHz may be 0.2 s
// late at most; at twice a search there takes four times as long.
constexpr std::size_t most_exposures = 1024;

// Records in a row that come too early and so are of a board whose time, or its estimate, has
// stepped. At half (1) a single lie costs a start; at twice a step costs twice as many frames
// before the start.
constexpr int early_to_step = 3;

// Exposures that a search keeps even when no frame of them can arrive any more. At half slow
// patterns may lose their beginning; at twice more old ones compete.
constexpr std::size_t exposures_for_search = 32;

// Frames known to be lost whose triggers have not been given up yet. At half a burst of losses is
// reported without reasons; at twice memory.
constexpr std::size_t shortfalls_kept = 32;

// Frames in a row for which two kinds of evidence must agree against the third. At half (2) one
// coincidence is enough to lock wrongly; at twice a slip costs twice as many frames.
constexpr int frames_to_relock = 3;

// Frames without agreement after which the relation is searched anew. At half a few late frames
// cost a start pattern; at twice a true slip costs twice as many frames first.
constexpr int frames_to_give_up = 5;

// ... but not before this time: lateness passes. At half a busy moment of the host costs a start
// pattern; at twice fast cameras wait longer for theirs.
constexpr Duration shortest_check = milliseconds(100);

// The same without a camera's clock, where nothing else distinguishes a late frame from a trigger
// that was missed. At half frames that were only late cost a slow start; at twice real slips last
// longer.
constexpr Duration shortest_check_by_arrival = milliseconds(300);

// Ids this far behind the newest are of frames out of order; further behind, of a counter that
// began anew. At half links that reorder more look like it; at twice a restart is seen as disorder.
constexpr std::uint64_t ids_back = 16;

// Start patterns that fail before a slow start is tried. At half a second fault during the start
// costs a slow one; at twice cameras that need the slow one wait for two more patterns.
constexpr int patterns_before_slow = 2;

// Starts asked for without a pause between them. At half trouble that passes lasts longer; at twice
// a camera that can never be paired loses more triggers.
constexpr int starts_in_a_row = 3;

// Most that the pauses grow to, in durations of a start. At half a hopeless camera loses twice the
// triggers; at twice it is found twice as late once it is repaired.
constexpr int longest_patience = 10;

// What a slow start takes: `frames_for_proof` pulses a second apart, and the same again for frames
// in the air or lost. At half one lost frame fails the start; at twice a failed one costs 12 s.
constexpr Duration slow_duration = seconds(6);

// How long frames wait for a search to succeed. At half slow starts lose their first frames; at
// twice buffers are held for longer by a camera that is never found.
constexpr Duration search_patience = seconds(10);

// The same in periods, on top, for slow cameras. At half one at 0.5 Hz loses frames of its pattern;
// at twice it holds buffers for longer.
constexpr std::int64_t search_patience_periods = 10;

// How far two stamps of a stepped clock may be off from their exposures' distance, for jitter. At
// half coarse clocks never prove that they stepped; at twice steps on the way are found later.
constexpr std::int64_t step_tolerance_ns = 30'000;

// The same for its rate, per time between them. At half bad crystals never prove that they
// stepped; at twice it matters only for frames seconds apart.
constexpr double step_tolerance_rate = 500e-6;

// How close a frame must come to an exposure by the camera's clock to name it, in smallest gaps. At
// half frames after a long silence slip; at twice, every time is close to some exposure.
constexpr double close_by_clock = 0.25;

// How close it must come to be published, in smallest gaps, if it was not closer before. At half
// clocks that jitter slip; at twice a record that is wrong by 2 ms at 20 Hz passes.
constexpr double steady_clock = 0.02;

// How far from its usual lateness a frame may arrive and still say which exposure it is of, in
// smallest gaps. At half jitter makes arrival silent; at twice (2/3) two exposures would do.
constexpr double close_by_arrival = 1.0 / 3;

// How far the newest record must reach up to a frame's arrival, less this part of a gap, before the
// frame is judged without newer ones. At half it waits a little longer; at twice a record may miss.
constexpr double record_may_lack = 0.75;

// A frame this much later than usual, in smallest gaps, could be of the exposure after. At half
// jitter makes frames wait for a witness; at twice (4/3) one period late passes as usual.
constexpr double late_part = 2.0 / 3;

// A frame this much quicker than the quickest so far, in smallest gaps, is of an earlier exposure.
// At half jitter at a start slips; at twice (4/3) a frame one period early passes.
constexpr double early_part = 2.0 / 3;

// Mean deviation of the arrivals beyond which they say nothing, in smallest gaps. At half ordinary
// jitter of fast cameras silences them; at twice (1/3) they speak when they may be one off.
constexpr double largest_deviation = 1.0 / 6;

// How far the usual lateness may grow past the shortest before frames must be queueing, in smallest
// gaps. At half slow links fall silent; at twice (1.5) a dropped frame of a queue is not noticed.
constexpr double largest_queue = 0.75;

double in_gaps(std::int64_t ns, std::int64_t gap_ns) {
    return static_cast<double>(ns) / static_cast<double>(gap_ns);
}

}  // namespace

const char* to_string(State state) {
    switch (state) {
        case State::searching: return "searching";
        case State::checking: return "checking";
        case State::locked: return "locked";
    }
    return "unknown";
}

Duration longest_latest_arrival(Duration period) {
    return period * static_cast<std::int64_t>(most_exposures - exposures_for_search) -
           usual_exposure_wait;
}

Pairing::Pairing(const Limits& limits, Outcome& outcome)
    : limits_(limits),
      outcome_(outcome),
      by_clock_(limits.camera_clock),
      exposures_(limits.period),
      delay_(limits),
      clock_(limits.stamped) {}

std::int64_t Pairing::loose_ns() const {
    return part_of(exposures_.smallest_gap_ns(), by_clock_ ? close_by_clock : close_by_arrival);
}

std::span<const Instant> Pairing::instants() const {
    static constexpr Instant arrival[] = {Instant::arrival};
    return by_clock_ ? clock_.possible() : arrival;
}

std::int64_t Pairing::expected_ns(Instant instant, const Arrival& arrival) const {
    return instant == Instant::arrival ? latency_.expected_instant_ns(arrival.arrived.ns)
                                       : clock_.expected_instant_ns(instant, arrival.camera_time);
}

std::int64_t Pairing::tolerance_ns(Instant instant, const Arrival& arrival) const {
    return std::min(loose_ns(), clock_.tolerance_ns(instant, arrival.camera_time));
}

/// While it is unknown what the camera stamps, that is taken by which ids and arrival agree.
Pairing::Reading Pairing::read(const Arrival& arrival) const {
    Reading best;
    for (const Instant instant : instants()) {
        Reading reading{instant, expected_ns(instant, arrival)};
        reading.record = exposures_.near(instant, reading.instant_ns, loose_ns());
        reading.verified = reading.record != nullptr && verified(arrival, *reading.record);
        const bool first = best.instant == Instant::unknown || (reading.verified && !best.verified);
        if (!first && reading.verified && reading.record != best.record)
            best.ambiguous = true;
        else if (first || (reading.verified && !steady(arrival, best)))
            best = reading;
    }
    return best;
}

/// The camera's clock fits as well as it did so far: neither it nor the record is off.
bool Pairing::steady(const Arrival& arrival, const Reading& reading) const {
    if (!by_clock_ || !seen(reading.record->exposure, reading.instant)) return true;
    const std::int64_t off_ns = reading.instant_ns - reading.record->instant_ns(reading.instant);
    return std::abs(off_ns) <= std::max(part_of(exposures_.smallest_gap_ns(), steady_clock),
                                        tolerance_ns(reading.instant, arrival));
}

void Pairing::add(const Exposure& exposure) {
    if (!follows(exposure)) return outcome_.exposure_unpaired(exposure, EventReason::mismatch);
    if (delay_.too_early(exposure)) return refuse_early(exposure);
    early_ = 0;
    accept(exposure);
    process();
}

/// The filter of records lets no other pass, but not each recording went through it.
bool Pairing::follows(const Exposure& exposure) const {
    if (exposure.end < exposure.start) return false;
    if (exposures_.empty()) return true;
    const Exposure& newest = exposures_.back().exposure;
    return exposure.trigger > newest.trigger && exposure.start > newest.start;
}

void Pairing::accept(const Exposure& exposure) {
    delay_.take(exposure);
    exposures_.add(exposure, delay_.prompt());
    const auto in_flight = static_cast<std::size_t>(
        (limits_.latest_arrival + limits_.exposure_wait).ns / limits_.period.ns);
    const std::size_t kept =
        std::clamp(in_flight + exposures_for_search, fewest_exposures, most_exposures);
    if (exposures_.size() > kept) drop_oldest_exposure(EventReason::frame_missing);
}

/// It lies, or the board is ahead of its clock's estimate, as those after it will show: nothing can
/// be proved by that, and all that was learned by that time is void then.
void Pairing::refuse_early(const Exposure& exposure) {
    outcome_.exposure_unpaired(exposure, EventReason::mismatch);
    if (++early_ < early_to_step) return;
    early_ = 0;
    while (!exposures_.empty()) drop_oldest_exposure(EventReason::reset);
    if (state_ != State::searching) search_anew();
    delay_ = RecordDelay(limits_);
}

void Pairing::add(const Arrival& arrival) {
    last_arrival_ = arrival.arrived;
    ++frames_;
    ++frames_since_start_;
    if (state_ == State::searching) {
        const bool by_clock = limits_.camera_clock && arrival.camera_time.ns != 0;
        while (by_clock != by_clock_ && !arrivals_.empty()) drop_front(EventReason::unproved);
        if (by_clock != by_clock_) given_up_.clear();
        by_clock_ = by_clock;
    }
    if (arrivals_.size() >= limits_.frames_held) {
        if (state_ == State::searching) given_up_.push_back(arrivals_.front());
        if (given_up_.size() > frames_in_search) given_up_.pop_front();
        expire_front();
    }
    arrivals_.push_back(arrival);
    process();
}

void Pairing::add(const Shortfall& shortfall) { note(shortfall); }

void Pairing::note(const Shortfall& shortfall) {
    shortfalls_.push_back(shortfall);
    if (shortfalls_.size() > shortfalls_kept) shortfalls_.pop_front();
}

void Pairing::process() {
    if (!delay_.live()) return;
    if (state_ == State::searching) search();
    while (state_ != State::searching && !arrivals_.empty() &&
           (state_ == State::locked ? decide_locked() : decide_checking())) {
    }
}

/// An exposure whose record is still on its way could explain the frame, too.
bool Pairing::records_complete(const Arrival& arrival) const {
    if (exposures_.empty()) return false;
    const Duration until = exposures_.back().exposure.earliest_on_host - arrival.arrived;
    return until.ns > -part_of(exposures_.smallest_gap_ns(), record_may_lack);
}

/// The oldest frames may be of another life of camera or board: they need no place in the
/// alignment. The newest wait for their records, which may always be some frames behind.
void Pairing::search() {
    const std::size_t enough = frames_for_proof(by_clock_ && start_ != Start::slow);
    std::vector<Arrival> all(given_up_.begin(), given_up_.end());
    all.insert(all.end(), arrivals_.begin(), arrivals_.end());
    const auto incomplete = std::find_if_not(
        all.begin(), all.end(), [this](const Arrival& frame) { return records_complete(frame); });
    const std::uint64_t newest = frames_ - static_cast<std::uint64_t>(all.end() - incomplete);
    all.erase(incomplete, all.end());
    if (newest == searched_) return;  // a record more says nothing of frames before it
    searched_ = newest;
    const std::size_t oldest = all.size() - std::min(all.size(), frames_in_search);
    for (std::size_t first = oldest; first + enough <= all.size(); ++first) {
        const auto begin = all.begin() + static_cast<std::ptrdiff_t>(first);
        const auto triggers = find_alignment({begin, all.end()});
        if (triggers.empty()) continue;
        for (std::size_t i = 0; i < first; ++i)
            if (given_up_.empty())
                drop_front(EventReason::unproved);
            else
                given_up_.pop_front();
        return lock(triggers);
    }
}

std::vector<std::uint64_t> Pairing::find_alignment(const std::vector<Arrival>& frames) const {
    auto found = align(frames, exposures_, instants(), limits_);
    if (by_clock_ && !exposures_.takes_seen() && quicker_than_ever(frames, found)) found.clear();
    // Slow triggers are regular, but so far apart that arrivals alone prove it.
    if (found.empty() && start_ == Start::slow)
        found = align(frames, exposures_, std::array{Instant::arrival}, limits_);
    return found;
}

/// Frames of a camera that ignores triggers unseen may imitate a place that is newer than theirs:
/// then they seem to come sooner than any did.
bool Pairing::quicker_than_ever(const std::vector<Arrival>& frames,
                                const std::vector<std::uint64_t>& triggers) const {
    for (std::size_t i = 0; i < triggers.size() && quickest_ns_; ++i)
        if (triggers[i] != 0 &&
            quicker_than(*quickest_ns_, frames[i], *exposures_.find(triggers[i])))
            return true;
    return false;
}

void Pairing::lock(const std::vector<std::uint64_t>& triggers) {
    const std::uint64_t first =
        *std::find_if(triggers.begin(), triggers.end(), [](auto t) { return t != 0; });
    forget_exposures_before(first);
    state_ = State::locked;
    clock_.forget();
    latency_ = Relation(false);
    shortest_delay_ns_ = INT64_MAX;
    fruitless_starts_ = 0;
    end_start_soon();
    outcome_.locked(exposures_.front().exposure);
    for (const std::uint64_t trigger : triggers)
        if (!given_up_.empty()) {
            if (trigger != 0)
                outcome_.exposure_unpaired(learn(given_up_.front(), trigger).exposure,
                                           EventReason::unproved);
            given_up_.pop_front();
        } else if (trigger != 0) {
            pair_front(trigger);
        } else {
            drop_front(EventReason::unproved);
        }
    given_up_.clear();
}

/// The pauses between starts are over, but not a start that the board may still carry out.
void Pairing::end_start_soon() { start_ends_ = std::min(start_ends_, start_carried_out_); }

/// False while the record of the exposure there may come: unless the frame would have arrived
/// before it was exposed.
bool Pairing::may_still_be_recorded(const Arrival& arrival, const Reading& reading) const {
    const Record& newest = exposures_.back();
    if (reading.instant_ns - newest.instant_ns(reading.instant) <= loose_ns()) return false;
    if (!by_clock_) return true;
    const HostTime on_host = newest.end_on_host + (BoardTime{reading.instant_ns} - newest.end);
    return arrival.arrived - on_host >= limits_.earliest_arrival;
}

/// This frame, or a newer one, was published before: ids and time agree on that.
bool Pairing::out_of_order(const Arrival& arrival) const {
    const std::uint64_t newest = proved_->arrival.block_id;
    if (arrival.block_id > newest || arrival.block_id + ids_back < newest) return false;
    if (!by_clock_) return true;
    const auto is_behind = [&](Instant instant) {
        const std::int64_t behind =
            proved_->record.instant_ns(instant) - expected_ns(instant, arrival);
        return behind >= -loose_ns() && behind <= limits_.latest_arrival.ns;
    };
    return std::any_of(instants().begin(), instants().end(), is_behind);
}

bool Pairing::ids_agree(const Arrival& arrival, const Record& record) const {
    return step_faults(arrival.block_id - proved_->arrival.block_id, proved_->record, record) == 0;
}

bool Pairing::verified(const Arrival& arrival, const Record& record) const {
    return !record.used && record.exposure.exposed &&
           arrival_possible(limits_, arrival, record.exposure) && ids_agree(arrival, record) &&
           !length_contradicts(arrival, record.exposure) && (record.prompt || by_clock_) &&
           ((record.prompt && by_clock_) || ids_exact(arrival, record)) &&
           (record.prompt || perhaps_not_taken(proved_->record, record) == 0);
}

/// Were a trigger left out of the count, a frame of the exposure before would do as well: it would
/// only be late, or the board's time was set back, and the record is late.
bool Pairing::ids_exact(const Arrival& arrival, const Record& record) const {
    return arrival.block_id - proved_->arrival.block_id ==
           record.exposure.trigger - proved_->record.exposure.trigger;
}

/// Decides the oldest waiting frame. False when it must wait for its exposure's record.
bool Pairing::decide_locked() {
    const Arrival arrival = arrivals_.front();
    if (exposures_.empty()) return false;
    const Reading reading = read(arrival);
    const Record* record = reading.record;
    if (!reading.verified && may_still_be_recorded(arrival, reading)) return false;
    if (out_of_order(arrival)) {
        drop_front(EventReason::out_of_order);
    } else if (record == nullptr &&
               reading.instant_ns > proved_->record.instant_ns(reading.instant) &&
               exposures_.lost_near(reading.instant, reading.instant_ns,
                                    proved_->record.exposure.trigger)) {
        drop_front(EventReason::exposure_missing);
    } else if (record != nullptr && !record->exposure.exposed) {
        drop_front(EventReason::trigger_ignored);  // the exposure line says that there was none
    } else if (reading.verified && !reading.ambiguous && steady(arrival, reading) &&
               !early(arrival, *record) && (by_clock_ || latency_trusted())) {
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
    return latency_.expected_instant_ns(arrival.arrived.ns) - record.end_on_host.ns;
}

/// A frame may be late, but not earlier than the quickest ever was.
bool Pairing::early(const Arrival& arrival, const Record& record) const {
    return quicker_than(shortest_delay_ns_, arrival, record);
}

bool Pairing::quicker_than(std::int64_t delay_ns, const Arrival& arrival,
                           const Record& record) const {
    const std::int64_t own_ns = (arrival.arrived - record.end_on_host).ns;
    return own_ns < delay_ns - part_of(exposures_.smallest_gap_ns(), early_part);
}

/// Frames that come later and later wait for each other somewhere. When one of them is dropped, the
/// others come earlier by a period, and seem to be of the trigger before, as they do by their ids
/// if those do not count the dropped one.
bool Pairing::latency_trusted() const {
    const std::int64_t gap = exposures_.smallest_gap_ns();
    return in_gaps(latency_.deviation_ns(), gap) <= largest_deviation &&
           in_gaps(latency_.difference_ns() - shortest_delay_ns_, gap) < largest_queue;
}

bool Pairing::punctual(const Arrival& arrival, const Record& record) const {
    return in_gaps(std::abs(lateness_ns(arrival, record)), exposures_.smallest_gap_ns()) <
           close_by_arrival;
}

bool Pairing::late(const Arrival& arrival, const Record& record) const {
    return in_gaps(lateness_ns(arrival, record), exposures_.smallest_gap_ns()) > late_part;
}

/// Where ids leave a choice, because a trigger may have been ignored, a camera clock that steps
/// back by as many periods lets both agree on a wrong exposure. Only the arrival, which seems late,
/// speaks against it.
bool Pairing::needs_witness(const Arrival& arrival, const Record& record) const {
    const bool all_taken = record.exposure.kind != StampKind::trigger_edge &&
                           record.exposure.trigger > proved_->record.exposure.trigger &&
                           perhaps_not_taken(proved_->record, record) == 0;
    return by_clock_ && !all_taken && (late(arrival, record) || !latency_trusted());
}

/// A later frame for which all three kinds of evidence agree: then the two did not step before it
/// either.
bool Pairing::has_witness() const {
    return std::any_of(arrivals_.begin() + 1, arrivals_.end(), [this](const Arrival& later) {
        const Reading reading = read(later);
        return reading.verified && latency_trusted() && punctual(later, *reading.record);
    });
}

void Pairing::slip(const Arrival& arrival) {
    state_ = State::checking;
    hypotheses_ = {};
    undecided_ = 0;
    slipped_ = arrival.arrived;
    outcome_.slipped(arrival);
}

/// The exposure that the camera's clock fits as well as it ever did.
const Record* Pairing::by_clock(const Arrival& arrival) const {
    const Record* found = nullptr;
    if (!by_clock_ || arrival.camera_time.ns == 0) return found;
    for (const Instant instant : instants()) {
        const Record* record =
            exposures_.near(instant, expected_ns(instant, arrival), tolerance_ns(instant, arrival));
        if (found == nullptr || (record != nullptr && verified(arrival, *record))) found = record;
    }
    return found;
}

/// None as well when frames come too irregularly.
const Record* Pairing::by_latency(const Arrival& arrival) const {
    if (!latency_trusted()) return nullptr;
    return exposures_.near(Instant::arrival, latency_.expected_instant_ns(arrival.arrived.ns),
                           part_of(exposures_.smallest_gap_ns(), close_by_arrival));
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

bool Pairing::ids_far_off(const Arrival& arrival, const Record& record) const {
    const std::uint64_t sent = record.exposure.trigger - proved_->record.exposure.trigger;
    const std::uint64_t counted = arrival.block_id - proved_->arrival.block_id;
    return std::abs(static_cast<std::int64_t>(counted - sent)) >
           static_cast<std::int64_t>(ids_back);
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
    const Reading reading = read(arrival);
    const bool all_agree = reading.verified && reading.record == late && steady(arrival, reading);
    // Where ids leave a choice, a late frame of a clock that stepped by as much agrees as well.
    const bool choice = all_agree && perhaps_not_taken(proved_->record, *late) != 0;
    if (all_agree && by_clock_ && !choice) {
        relock(*late);  // nothing stepped after all
        return true;
    }
    // Without a camera clock, arrivals alone say where the frames are. They may be off by the few
    // periods by which the board's time stepped; a counter that began anew is off by more.
    const bool anew = !by_clock_ && late != nullptr && ids_far_off(arrival, *late);
    const Record* clocked = anew ? late : by_clock(arrival);
    // A late record may be of a board whose time was set back: then clock and arrival have stepped.
    const bool ids_may_have_stepped = clocked != nullptr && clocked == late && clocked->prompt &&
                                      !clocked->used && clocked->exposure.exposed;
    // A clock that steps does not hit another exposure to some microseconds. When it fits so well,
    // it is ids and arrivals that have stepped together.
    const Record* counted = by_clock_ && clocked == nullptr ? by_ids(arrival) : nullptr;
    // Without the camera's clock a single frame may come when one of another exposure would.
    if (!suspect(Stepped::nothing, arrival, all_agree ? late : nullptr) &&
        !suspect(Stepped::ids, arrival, ids_may_have_stepped ? clocked : nullptr) &&
        !suspect(Stepped::clock, arrival, counted == late ? counted : nullptr))
        give_up_front();
    return true;
}

/// True when it is certain by now: then the frame was published.
bool Pairing::suspect(Stepped kind, const Arrival& arrival, const Record* record) {
    SlipHypothesis& suspicion = hypotheses_[static_cast<std::size_t>(kind)];
    if (record == nullptr) {
        suspicion.frames = 0;
        return false;
    }
    const Pair now{arrival, *record};
    suspicion.frames = consistent(kind, suspicion.last, now) ? suspicion.frames + 1 : 1;
    suspicion.last = now;
    if (suspicion.frames < frames_to_relock) return false;
    if (kind == Stepped::clock) clock_.move(arrival.camera_time, *record);
    relock(*record);
    return true;
}

void Pairing::relock(const Record& record) {
    state_ = State::locked;
    outcome_.locked(record.exposure);
    pair_front(record.exposure.trigger);
}

/// What stepped must be steady since.
bool Pairing::consistent(Stepped kind, const Pair& before, const Pair& now) const {
    if (step_faults(now.arrival.block_id - before.arrival.block_id, before.record, now.record) != 0)
        return false;
    if (kind != Stepped::clock) return true;
    const std::int64_t step = (now.arrival.camera_time - before.arrival.camera_time).ns;
    return std::any_of(instants().begin(), instants().end(), [&](Instant instant) {
        const std::int64_t elapsed =
            now.record.instant_ns(instant) - before.record.instant_ns(instant);
        return std::abs(step - elapsed) <=
               step_tolerance_ns + part_of(elapsed, step_tolerance_rate);
    });
}

void Pairing::give_up_front() {
    const Duration since = arrivals_.front().arrived - slipped_;
    const Duration shortest = by_clock_ ? shortest_check : shortest_check_by_arrival;
    if (++undecided_ < frames_to_give_up || since < shortest)
        return drop_front(EventReason::unproved);
    drop_front(EventReason::mismatch);
    search_anew();
}

/// The start is wanted at once.
void Pairing::search_anew() {
    state_ = State::searching;
    delay_.forget();
    frames_since_start_ = static_cast<int>(frames_for_proof(by_clock_));
}

std::optional<Start> Pairing::wanted_start(HostTime now) const {
    if (state_ == State::locked && start_ == Start::slow) return Start::steady;
    if (state_ != State::searching) return std::nullopt;
    const bool futile = !by_clock_ && start_ == Start::pattern;
    if (!futile && now <= start_ends_) return std::nullopt;
    if (frames_since_start_ < static_cast<int>(frames_for_proof(by_clock_))) return std::nullopt;
    const bool slow =
        !by_clock_ || fruitless_starts_ % (patterns_before_slow + 1) == patterns_before_slow;
    return slow ? Start::slow : Start::pattern;
}

void Pairing::start_requested(Start start, HostTime now) {
    start_ = start;
    if (start == Start::steady) {  // and ends the slow one
        start_carried_out_ = std::min(start_carried_out_, now + limits_.latest_arrival);
        return end_start_soon();
    }
    ++fruitless_starts_;
    frames_since_start_ = 0;
    // A start costs triggers: what does not help is asked for less and less often.
    const int patience = std::clamp(fruitless_starts_ - starts_in_a_row, 1, longest_patience);
    const Duration duration = start == Start::slow ? slow_duration : limits_.pattern_duration;
    start_carried_out_ = now + duration + limits_.latest_arrival;
    start_ends_ = now + (duration + limits_.latest_arrival) * patience;
}

Arrival Pairing::take_front() {
    const Arrival arrival = arrivals_.front();
    arrivals_.pop_front();
    waits_for_witness_ = false;
    return arrival;
}

void Pairing::pair_front(std::uint64_t trigger) {
    const Arrival arrival = take_front();
    outcome_.paired(arrival, learn(arrival, trigger).exposure);
}

const Record& Pairing::learn(const Arrival& arrival, std::uint64_t trigger) {
    forget_exposures_before(trigger);
    Record& record = *exposures_.find(trigger);
    record.used = true;
    if (arrival.camera_time.ns != 0) clock_.track(arrival.camera_time, record);
    const std::int64_t delay_ns = (arrival.arrived - record.end_on_host).ns;
    shortest_delay_ns_ = std::min(shortest_delay_ns_, delay_ns);
    quickest_ns_ = quickest_ns_ ? std::min(*quickest_ns_, delay_ns) : delay_ns;
    if (!latency_.known() || punctual(arrival, record))
        latency_.track(arrival.arrived.ns, record.end_on_host.ns);
    proved_ = Pair{arrival, record};
    return record;
}

/// It has waited too long.
void Pairing::expire_front() {
    if (state_ == State::locked && waits_for_witness_) slip(arrivals_.front());  // frames stay late
    drop_front(state_ == State::locked ? EventReason::exposure_missing : EventReason::unproved);
}

void Pairing::drop_front(EventReason reason) {
    const Arrival arrival = take_front();
    if (reason != EventReason::out_of_order) note({arrival.block_id, reason});
    const Record* guess = nullptr;
    if (proved_ && state_ != State::searching) guess = read(arrival).record;
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
    const Duration patience = state_ == State::searching
                                  ? search_patience + limits_.period * search_patience_periods
                                  : limits_.exposure_wait;
    return !arrivals_.empty() && now - arrivals_.front().arrived > patience;
}

/// A search needs the exposures of several frames, however slow the camera.
bool Pairing::exposure_expired(HostTime now) const {
    const std::size_t keep = state_ == State::searching ? exposures_for_search : 0;
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
    by_clock_ = limits.camera_clock;
    exposures_ = ExposureLog(limits.period);
    delay_ = RecordDelay(limits);
    clock_ = CameraClock(limits.stamped);
    quickest_ns_.reset();
}

void Pairing::reset() {
    while (!arrivals_.empty()) drop_front(EventReason::reset);
    given_up_.clear();
    while (!exposures_.empty()) drop_oldest_exposure(EventReason::reset);
    state_ = State::searching;
    delay_ = RecordDelay(limits_);
    early_ = 0;
    shortfalls_.clear();
    fruitless_starts_ = 0;
    frames_since_start_ = 0;
    end_start_soon();
}

}  // namespace versavis::pairing
