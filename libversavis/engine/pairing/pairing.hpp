// SPDX-License-Identifier: BSD-3-Clause
// Finds for each frame of one camera the exposure that made it, and proves it.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "engine/pairing/alignment.hpp"
#include "engine/pairing/camera_clock.hpp"
#include "engine/pairing/record_delay.hpp"
#include "engine/pairing/relation.hpp"

namespace versavis::pairing {

/// What pairing decides. Each arrival and each exposure comes back exactly once.
class Outcome {
 public:
    virtual ~Outcome() = default;
    virtual void paired(const Arrival& arrival, const Exposure& exposure) = 0;

    /// `guess`: the exposure that it may be of, unproved; null when there is none.
    virtual void frame_unpaired(const Arrival& arrival, EventReason reason,
                                const Exposure* guess) = 0;
    virtual void exposure_unpaired(const Exposure& exposure, EventReason reason) = 0;
    virtual void locked(const Exposure& first) = 0;
    virtual void slipped(const Arrival& at) = 0;
};

enum class State {
    searching,  ///< no relation is known: the gaps between frames are held against those between
                ///< exposures
    checking,   ///< a slip was found: frames are unproved until all evidence, or all but one kind,
                ///< agrees again
    locked,     ///< each frame is verified against ids and times before it is published
};
const char* to_string(State state);

/// How the board should trigger the camera.
enum class Start : std::uint32_t {
    pattern = 1,  ///< irregular gaps at the working rate, then all
    slow = 2,     ///< one pulse a second, until another start is asked for
    steady = 3,   ///< all
};

/// The longest `latest_arrival` that has any effect for a camera of this period: so many exposures
/// are remembered.
Duration longest_latest_arrival(Duration period);

/// Method. Three kinds of evidence count triggers, each in its own way: the camera's clock,
/// followed against the board's; block ids, from the newest published frame; and the time from the
/// end of the exposure to the arrival, whose usual value is learned and which has hard limits. A
/// frame is published when clock and ids name the same exposure and the arrival is possible. When
/// they contradict each other, nothing is published until one kind is found to have stepped,
/// because the two others agree on several frames in a row; that one is then counted from there.
/// When no two agree, the relation is searched anew, from triggers with irregular gaps
/// (alignment.hpp). Cameras without a clock are paired by ids and arrival, and found by slow
/// triggers. Not thread-safe. Times only enter through the arguments: the same calls lead to the
/// same decisions.
class Pairing {
 public:
    Pairing(const Limits& limits, Outcome& outcome);

    void add(const Exposure& exposure);
    void add(const Arrival& arrival);
    void add(const Shortfall& shortfall);

    /// For RecordDelay::compared().
    void compared(std::uint64_t exchanges, bool agree) { delay_.compared(exchanges, agree); }

    /// Gives up what has waited too long.
    void advance(HostTime now);

    /// True when advance() would change anything.
    bool due(HostTime now) const;

    /// For a new stream of the camera; between reset() and the first evidence.
    void set_limits(const Limits& limits);

    /// Gives back everything and searches anew: camera or board began a new life, or the board's
    /// clock is estimated anew. A start that the board carries out goes on.
    void reset();

    State state() const { return state_; }

    /// By how much the newest record came later than usual, while nothing is decided for that.
    Duration records_late_by() const { return delay_.late_by(); }

    /// What the camera stamps, by what was said or found out.
    Instant stamped() const { return clock_.stamped(); }

    /// What the board should do for this camera now; none: go on. Call start_requested()
    /// once it was asked to.
    std::optional<Start> wanted_start(HostTime now) const;
    void start_requested(Start start, HostTime now);

    /// How the first start should be, before anything is known.
    Start first_start() const { return by_clock_ ? Start::pattern : Start::slow; }

 private:
    /// What may have stepped at a slip, so that the other kinds of evidence still agree.
    enum class Stepped : std::size_t { ids, clock, nothing };

    struct Pair {
        Arrival arrival;
        Record record;
    };
    struct SlipHypothesis {  ///< of one kind of evidence
        int frames = 0;
        Pair last;
    };

    /// What the time of a frame says of its exposure.
    struct Reading {
        Instant instant{};  ///< by which it is read
        std::int64_t instant_ns = 0;
        const Record* record = nullptr;  ///< the exposure there
        bool verified = false;           ///< ids and arrival agree
        bool ambiguous = false;          ///< they do with another one, by another instant
    };

    std::span<const Instant> instants() const;
    std::int64_t expected_ns(Instant instant, const Arrival& arrival) const;
    std::int64_t tolerance_ns(Instant instant, const Arrival& arrival) const;
    std::int64_t loose_ns() const;
    Reading read(const Arrival& arrival) const;
    bool steady(const Arrival& arrival, const Reading& reading) const;

    bool follows(const Exposure& exposure) const;
    void accept(const Exposure& exposure);
    void refuse_early(const Exposure& exposure);
    void search_anew();

    void process();
    bool records_complete(const Arrival& arrival) const;
    void search();
    std::vector<std::uint64_t> find_alignment(const std::vector<Arrival>& frames) const;
    bool quicker_than_ever(const std::vector<Arrival>& frames,
                           const std::vector<std::uint64_t>& triggers) const;
    void end_start_soon();
    void lock(const std::vector<std::uint64_t>& triggers);

    bool decide_locked();
    bool may_still_be_recorded(const Arrival& arrival, const Reading& reading) const;
    bool out_of_order(const Arrival& arrival) const;
    bool verified(const Arrival& arrival, const Record& record) const;
    bool ids_agree(const Arrival& arrival, const Record& record) const;
    bool ids_far_off(const Arrival& arrival, const Record& record) const;
    bool ids_exact(const Arrival& arrival, const Record& record) const;
    std::int64_t lateness_ns(const Arrival& arrival, const Record& record) const;
    bool latency_trusted() const;
    bool punctual(const Arrival& arrival, const Record& record) const;
    bool late(const Arrival& arrival, const Record& record) const;
    bool early(const Arrival& arrival, const Record& record) const;
    bool quicker_than(std::int64_t delay_ns, const Arrival& arrival, const Record& record) const;
    bool needs_witness(const Arrival& arrival, const Record& record) const;
    bool has_witness() const;
    const Record* by_clock(const Arrival& arrival) const;
    const Record* by_latency(const Arrival& arrival) const;
    const Record* by_ids(const Arrival& arrival) const;

    void slip(const Arrival& arrival);
    bool decide_checking();
    bool suspect(Stepped kind, const Arrival& arrival, const Record* record);
    void relock(const Record& record);
    bool consistent(Stepped kind, const Pair& before, const Pair& now) const;
    void give_up_front();

    Arrival take_front();
    void pair_front(std::uint64_t trigger);
    const Record& learn(const Arrival& arrival, std::uint64_t trigger);
    void expire_front();
    void drop_front(EventReason reason);
    void forget_exposures_before(std::uint64_t trigger);
    void drop_oldest_exposure(EventReason reason);
    bool arrival_expired(HostTime now) const;
    bool exposure_expired(HostTime now) const;
    EventReason explanation(const Record& record, EventReason otherwise);
    void note(const Shortfall& shortfall);

    Limits limits_;
    Outcome& outcome_;
    State state_ = State::searching;
    bool by_clock_ = true;  ///< of the camera, else by arrival
    ExposureLog exposures_;
    RecordDelay delay_;
    int early_ = 0;                 ///< records in a row that came too early
    std::deque<Arrival> arrivals_;  ///< not decided yet
    std::deque<Arrival> given_up_;  ///< by the search, for want of room: their times still count
    std::uint64_t frames_ = 0;      ///< that came
    std::uint64_t searched_ = 0;    ///< of those, up to the newest that was searched for
    std::deque<Shortfall> shortfalls_;
    CameraClock clock_;
    std::int64_t shortest_delay_ns_ = 0;       ///< from end of exposure to arrival, since the lock
    std::optional<std::int64_t> quickest_ns_;  ///< the same of all that was proved of this stream
    Relation latency_{false};                  ///< arrival against its end on the host
    std::optional<Pair> proved_;               ///< the newest that was published
    std::array<SlipHypothesis, 3> hypotheses_{};  ///< by Stepped
    bool waits_for_witness_ = false;              ///< the oldest frame does
    int undecided_ = 0;                           ///< frames since the slip
    HostTime slipped_;

    std::optional<Start> start_;  ///< asked for
    int fruitless_starts_ = 0;
    int frames_since_start_ = 0;
    HostTime last_arrival_;
    HostTime start_carried_out_;  ///< by the board, and no frame of it can come later
    HostTime start_ends_;  ///< no other start before: of two patterns within one arrival window, a
                           ///< frame of one could be taken for one of the other
};

}  // namespace versavis::pairing
