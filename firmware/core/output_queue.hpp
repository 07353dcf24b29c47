// SPDX-License-Identifier: BSD-3-Clause
// Edges of all outputs in one order: what was decided for each output, merged into words for the
// hardware.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/hal.hpp"

namespace versavis::firmware {

/// Receives the edges that left at another instant than set() said.
struct OutputMoves {
    virtual void moved(unsigned output, bool level, Nanoseconds asked, Nanoseconds left) = 0;

 protected:
    ~OutputMoves() = default;
};

/// Sorts the edges of all outputs by time and hands the port those that are due soon. Part of
/// Board, called from Board::poll() only; after a commit the port sends the words by interrupts.
class OutputQueue {
 public:
    /// Edges due within this time go to the hardware and can no longer be changed. If lower, a port
    /// that fills its hardware every 250 us has little room for a slow poll; if higher, exposures
    /// are expected from older measurements.
    static constexpr Nanoseconds horizon = 1'000'000;

    OutputQueue(OutputSchedule& hardware, OutputMoves& moves, const PortFacts& facts);

    /// True while `edges` more can be set of an output. The rooms of all outputs fit together.
    bool has_room(unsigned output, unsigned edges = 2) const {
        return counts_[output] + edges <= rooms[output];
    }
    bool empty() const { return size_ == 0; }

    /// Sets the level of `output` at `at`, or as soon as possible after what was already committed,
    /// and not sooner than `hold` after its previous edge: a late pulse keeps its width. Returns
    /// the instant requested. Without room nothing is set.
    Nanoseconds set(Nanoseconds at, unsigned output, bool level, Nanoseconds hold = 0);

    /// A pulse of `width` and, before it, the shortest pause that separates it from the previous
    /// one.
    Nanoseconds pulse(Nanoseconds at, unsigned output, bool active, Nanoseconds width) {
        const Nanoseconds begins = set(at, output, active, shortest_pause);
        set(begins + width, output, !active, width);
        return begins;
    }

    static constexpr Nanoseconds shortest_pause = 10'000;

    /// Later than rounding explains.
    bool is_late(Nanoseconds asked, Nanoseconds left) const { return left - asked > step_; }

    /// Hands what is due within the horizon to the hardware, at most `words_a_commit` words. False:
    /// its queue is full.
    bool commit(Nanoseconds now);

    /// When commit() is next needed; never: there is nothing to commit. Earlier calls commit more
    /// at once.
    Nanoseconds next_wake() const { return size_ == 0 ? never : edges_[0].at - refill; }

    /// The soonest that an edge set now can have.
    Nanoseconds soonest(Nanoseconds now) const {
        return committed_until_ >= now ? committed_until_ + step_ : now;
    }

    /// True: an edge of `output` that was due before `at` has not been committed.
    bool is_overdue(unsigned output, Nanoseconds at) const {
        if (counts_[output] == 0) return false;
        for (std::size_t i = 0; i < size_ && edges_[i].at < at; ++i)
            if (edges_[i].output == output) return true;
        return false;
    }

    /// Removes the edges of `output` that are not committed yet. Returns the level that remains.
    bool cancel(unsigned output);

    /// cancel(), then `level` as soon as possible. Returns when it is reached at the latest.
    Nanoseconds rest(unsigned output, bool level, Nanoseconds now) {
        if (cancel(output) != level) return set(now, output, level);
        return committed_until_ > now ? committed_until_ : now;
    }

    /// High-water mark of waiting edges since the last call.
    std::size_t take_high_water() {
        const std::size_t most = high_water_;
        high_water_ = size_;
        return most;
    }

 private:
    /// Aligned so that a Cortex-M0+ copies it without a call, in a third of the time.
    struct [[gnu::packed, gnu::aligned(4)]] PendingEdge {
        Nanoseconds at;
        Nanoseconds asked;
        std::uint32_t hold;
        std::uint8_t output;
        bool level;
    };
    /// When the first edge is that close, it is time to commit. If lower, a slow poll makes it
    /// late; if higher, pulse trains need more polls.
    static constexpr Nanoseconds refill = 500'000;
    /// Bounds the work of one poll. If lower, a fast pulse train takes two polls.
    static constexpr unsigned words_a_commit = 16;
    /// Edges of pulses that may wait at an output: what 10 kHz needs for the furthest that a pulse
    /// train looks ahead. If lower, such a train falls short; if higher, memory is wasted.
    static constexpr std::uint8_t pulse_room = 24;
    /// One light and the end of another.
    static constexpr std::uint8_t gate_room = 4;
    /// Those of eight plans, and one more.
    static constexpr std::uint8_t lead_room = 18;
    static constexpr std::uint8_t rooms[output_count] = {pulse_room, pulse_room, pulse_room,
                                                         pulse_room, gate_room,  lead_room,
                                                         pulse_room, pulse_room};
    static constexpr std::size_t capacity = 6 * pulse_room + gate_room + lead_room;

    void insert(const PendingEdge& edge);
    void remove_first(std::size_t count);
    bool held_back(const PendingEdge& edge, Nanoseconds at);
    bool push_word();

    OutputSchedule& hardware_;
    OutputMoves& moves_;
    Nanoseconds grain_;
    Nanoseconds step_;
    std::size_t size_ = 0;
    std::uint8_t counts_[output_count] = {};
    std::size_t high_water_ = 0;
    Nanoseconds committed_until_ = -never;
    std::uint32_t levels_ = 0;
    Nanoseconds changed_[output_count] = {};  ///< when its level changed last
    PendingEdge edges_[capacity];
};

}  // namespace versavis::firmware
