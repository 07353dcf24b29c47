// SPDX-License-Identifier: BSD-3-Clause
// Finds for each frame of one camera the exposure that made it, and proves it.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "versavis/metadata.hpp"
#include "versavis/time.hpp"

namespace versavis::pairing {

/// One trigger of the camera, as the board recorded it.
struct Exposure {
    std::uint64_t trigger = 0;  ///< consecutive: one per pulse
    std::uint64_t tick = 0;
    BoardTime start;  ///< start of the exposure, predicted when it was not measured
    BoardTime end;
    HostTime earliest_on_host;  ///< its end, or its start when the end was not seen: no frame of it can
                                ///< arrive earlier
    StampKind kind = StampKind::measured_middle;
    bool exposed = true;  ///< false: the exposure line is wired and stayed silent
};

/// One complete frame.
struct Arrival {
    std::uint32_t slot = 0;  ///< where its pixels lie; handed back in the outcome
    std::uint64_t block_id = 0;
    CameraTime camera_time;  ///< 0: the camera has no usable clock
    HostTime arrived;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t pixel_format = 0;
    std::uint32_t size = 0;  ///< bytes
};

/// What pairing decides. Each arrival and each exposure comes back exactly once.
class Outcome {
 public:
    virtual ~Outcome() = default;
    virtual void paired(const Arrival& arrival, const Exposure& exposure) = 0;
    virtual void frame_unpaired(const Arrival& arrival, EventReason reason) = 0;
    virtual void exposure_unpaired(const Exposure& exposure, EventReason reason) = 0;
    virtual void locked(const Exposure& first) = 0;
    virtual void slipped(const Arrival& at) = 0;
};

struct Limits {
    Duration earliest_arrival =
        milliseconds(-5);  ///< after the end of exposure; negative: error of translation
    Duration latest_arrival = milliseconds(500);  ///< after the end of exposure
    Duration exposure_wait = milliseconds(250);   ///< how long a frame waits for its exposure's record
    Duration pattern_duration = seconds(1);       ///< how long the board's start pattern takes
    std::size_t frames_held = 6;                  ///< most frames that wait for proof
};

enum class State {
    searching,  ///< no relation is known: the gaps between frames are held against those between exposures
    checking,   ///< a slip was found: frames are matched by camera time, but withheld until all evidence
                ///< agrees again
    locked,     ///< each frame is verified against ids and times before it is published
};
const char* to_string(State state);

/// Method. A frame belongs to the exposure whose start differs from the frame's camera time by the tracked
/// difference of the two clocks; the step of block ids must agree with the number of exposures since the last
/// pair, and the arrival must lie in its window. The difference of the clocks is found from an irregular
/// sequence of gaps: it is the alignment of the last frames with the exposures that needs no fault to explain
/// it, if every other needs two. Not thread-safe. Times only enter through the arguments.
class Pairing {
 public:
    Pairing(const Limits& limits, Outcome& outcome) : limits_(limits), outcome_(outcome) {}

    void add(const Exposure& exposure);
    void add(const Arrival& arrival);

    /// Gives up what has waited too long.
    void advance(HostTime now);

    /// Gives back everything and searches anew: camera or board began a new life.
    void reset();

    State state() const { return state_; }

    /// True when regular triggers cannot lead to a lock: the board should repeat its start pattern.
    bool wants_pattern(HostTime now) const;
    void pattern_requested(HostTime now);

 private:
    static constexpr int pattern_patience = 8;
    static constexpr std::size_t frames_for_proof = 4;
    static constexpr unsigned faults_to_refute = 2;
    static constexpr int frames_to_relock = 3;
    static constexpr std::size_t exposures_kept = 128;

    struct Record {
        Exposure exposure;
        bool used = false;
        std::uint64_t recorded = 0;  ///< records until this one, itself included
        std::uint64_t silent = 0;    ///< those of them without an exposure
    };
    struct Alignment {
        std::vector<std::uint64_t> triggers;  ///< of the waiting frames
        unsigned faults = 0;                  ///< ignored triggers that nobody saw, which it takes
        bool unknown = false;  ///< a frame falls where a record was lost: neither proved nor refuted
    };
    struct Pair {                    ///< the newest accepted match
        std::int64_t difference_ns;  ///< camera time - board time
        std::uint64_t block_id;
        Record record;
    };

    std::int64_t frame_time_ns(const Arrival& arrival) const;
    /// Twice this is half the way between neighbouring exposures.
    std::int64_t tolerance_ns() const { return smallest_gap_ns_ / 4; }
    bool arrival_possible(const Arrival& arrival, const Exposure& exposure) const;
    static unsigned step_faults(std::uint64_t id_step, const Record& from, const Record& to);
    std::size_t first_after(BoardTime start) const;
    const Record* near(BoardTime start) const;
    bool record_lost_near(BoardTime start) const;
    std::optional<Alignment> align(std::int64_t difference_ns) const;
    std::vector<std::int64_t> candidate_differences() const;
    void search();
    void accept_alignment(const std::vector<std::uint64_t>& triggers);
    void process();
    bool match_front();
    void decide_front(const Record& record);
    bool irregular(std::uint64_t first, std::uint64_t last) const;
    void search_anew(const Arrival& arrival);
    BoardTime expected_start(const Arrival& arrival) const;
    void track(const Arrival& arrival, const Record& record);
    void slip(const Arrival& arrival);
    void pair_front(std::uint64_t trigger);
    void drop_front(EventReason reason);
    void forget_exposures_before(std::uint64_t trigger, EventReason reason);
    void drop_oldest_exposure(EventReason reason);

    Limits limits_;
    Outcome& outcome_;
    State state_ = State::searching;
    std::deque<Record> exposures_;
    std::deque<Arrival> arrivals_;  ///< not decided yet
    std::optional<Pair> last_;
    std::optional<Pair> proved_;  ///< the newest that was published
    std::uint64_t recorded_ = 0;
    std::uint64_t silent_ = 0;
    int disagreeing_ = 0;
    std::int64_t smallest_gap_ns_ = INT64_MAX;
    double drift_ = 0;  ///< camera clock against board clock, relative
    bool camera_clock_ = true;
    int fruitless_ = 0;      ///< frames that came during the search
    HostTime next_pattern_;  ///< two patterns within one arrival window could be taken for each other
    int agreeing_ = 0;
};

}  // namespace versavis::pairing
