// SPDX-License-Identifier: BSD-3-Clause
// Edges of all outputs in one order: what was decided for each output, merged into words for the
// hardware.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal.hpp"

namespace versavis::firmware {

class OutputQueue {
 public:
    /// Edges due within this time go to the hardware and can no longer be changed.
    static constexpr Nanoseconds horizon = 1'000'000;

    explicit OutputQueue(OutputSchedule& hardware) : hardware_(hardware) {}

    /// True while the edges of a camera's pulse, its light and the test output can be set.
    bool has_room() const { return size_ + 8 <= capacity; }
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

    /// An edge that leaves later than requested; each is reported once.
    bool take_late(OutputSchedule::Late& late);

    /// Hands what is due within the horizon to the hardware. False: its queue is full.
    bool commit(Nanoseconds now);

    /// Instant of the first edge that is not committed yet; never: none.
    Nanoseconds next() const { return size_ == 0 ? never : edges_[0].at; }

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
    struct PendingEdge {
        Nanoseconds at;
        Nanoseconds asked;
        Nanoseconds hold;
        std::uint8_t output;
        bool level;
    };
    void insert(const PendingEdge& edge);
    void remove_first(std::size_t count);
    bool postpone_first(Nanoseconds now);

    static constexpr std::size_t output_count = 8;
    static constexpr std::size_t late_capacity = 16;
    static constexpr std::size_t capacity = 64;  // 8 outputs x 2 edges x 3 pulses ahead, with room

    OutputSchedule& hardware_;
    PendingEdge edges_[capacity] = {};
    std::size_t size_ = 0;
    std::size_t high_water_ = 0;
    Nanoseconds committed_until_ = INT64_MIN;
    std::uint32_t levels_ = 0;
    Nanoseconds changed_[output_count] = {};  ///< when its level changed last
    OutputSchedule::Late late_[late_capacity] = {};
    std::size_t late_count_ = 0;
};

}  // namespace versavis::firmware
