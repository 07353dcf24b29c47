// SPDX-License-Identifier: BSD-3-Clause
// Compares how long the messages of each stream take to the host with how long the answers of
// exchanges do, whatever the estimate of the clock makes of either.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "engine/clock/delay_edge.hpp"
#include "engine/clock/messages.hpp"
#include "engine/plausibility/persistence.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

/// What a stream can say of others.
enum class Witness : std::uint8_t {
    none,  ///< nothing: its times may be off alone
    grid,  ///< whether exchanges are right; its instants are on the trigger grid, with the other
           ///< cameras', and all of them may step without the clock
    own,   ///< the same, and its instants follow no other stream's
};

/// How much longer than answers the quickest messages of a stream take.
class UsualLead {
 public:
    bool known() const;

    /// How far `value` is from it, if that is more than it scatters by, or one of so many parts of
    /// that; else 0.
    Duration departure(Duration value, std::int64_t parts = 1) const;
    void learn(Duration value, HostTime now);

 private:
    Duration value_;
    HostTime newest_;
    double deviation_ns_ = 0;  ///< mean
    double widest_ns_ = 0;     ///< once it is settled
    int count_ = 0;
};

/// All messages of the board take the same way, so the delays of the quickest ones of a stream and
/// of the quickest answers at the same time differ by a constant. If a stream's times step or drift
/// away from those of the exchanges, that difference changes, even while the estimate of the clock
/// follows one of the two. Where it changes for all streams alike, the exchanges are in doubt, and
/// not the streams. A change that lasts (see Persistence) is the new usual.
///
/// Not thread-safe; Translator calls it under its lock.
class StreamWitnesses {
 public:
    /// The number of a new stream.
    std::size_t add_stream(Witness witness);

    /// A message and whether it fits those of its stream before it.
    void heard(std::size_t stream, const OffsetSample& message, bool fits);

    /// True: since the exchange before this one, messages fit those of their streams before them,
    /// and none took as long as usual if the times of this exchange are right. The board's clock
    /// cannot have stepped then, so they are wrong.
    bool deny(const Exchange& exchange) const;

    /// `skew`: host clock against board clock, ns/s.
    void exchanged(const Exchange& exchange, double skew);

    /// By how much all streams have left the exchanges, so that these may be wrong; 0: they have
    /// not.
    Duration doubt() const { return doubt_; }

    /// By how much exchanges may be off without being in doubt: what all streams have left them by,
    /// or what nothing can deny as the streams are too new. 0 where fewer than two streams talk.
    Duration allowance() const { return allowance_; }

    /// By how much the times of a stream are later than the exchanges allow, or earlier if
    /// negative; none: they are not.
    std::optional<Duration> departure(std::size_t stream) const;

    /// Its messages agree so well with the exchanges that the clock may be estimated by them, or
    /// exchanges may be wrong.
    bool steers(std::size_t stream) const;

    /// Those messages of a stream that do not fit those before agree with the exchanges; none: too
    /// little is known.
    std::optional<bool> confirms_others(std::size_t stream) const;

    /// No stream has messages any more that fit those before, and those of two or more agree with
    /// the exchanges, of which one at most is on the trigger grid: it is the board's clock that
    /// stepped, even where the link takes longer than the step is large.
    bool show_clock_step() const;

    /// Messages of before cannot be compared with later ones. The link is the same.
    void clock_stepped();

 private:
    /// Between two exchanges.
    struct Interval {
        std::optional<OffsetSample> quickest;
        int messages = 0;

        void add(const OffsetSample& message);
    };
    /// The quickest of all that are compared, and of the newest.
    struct Answers {
        Duration all;
        Duration newest;
    };
    struct Track {
        Interval open;
        std::deque<Interval> closed;  ///< the newest in front

        void close();
        bool silent() const;
        std::optional<OffsetSample> quickest(const StreamWitnesses& at) const;
    };
    struct Stream {
        Track fitting;
        Track others;
        UsualLead lead;
        Duration departure;
        Duration unusual;         ///< the same, by less
        std::size_t late = 0;     ///< intervals in a row
        Persistence persistence;  ///< of what departs
        bool others_confirmed = false;
        Witness witness = Witness::own;

        void forget_lead();
    };

    Duration aligned(const OffsetSample& sample) const;
    Duration quickest_answer(std::size_t newest) const;
    void close_interval(HostTime now);
    bool talks(const Stream& stream) const;
    bool too_new() const;
    Duration common(Duration Stream::*off) const;
    void compare(Stream& stream, const Answers& quickest_answers, HostTime now);

    std::vector<Stream> streams_;
    std::deque<OffsetSample> answers_;  ///< the newest in front
    Duration doubt_;
    Duration allowance_;
    bool all_unusual_ = false;
    BoardTime now_;
    HostTime closed_;
    double skew_ = 0;
};

}  // namespace versavis::clock
