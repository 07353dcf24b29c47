// SPDX-License-Identifier: BSD-3-Clause
// When the watcher took the samples that its words show.
#pragma once

#include "pio_programs.hpp"

namespace versavis::rp2040 {

/// From one word to the next, in the lower 32 bits of board time in nanoseconds. A word has only
/// the lower bits of its count: the clock shows which of the instants with such a count it was.
class SampleClock {
 public:
    /// Largest age of a sample when it is read.
    static constexpr std::uint32_t oldest = 40'000'000;

    /// The next word, with this count. `now` is of a clock that knows whole microseconds.
    void next(std::uint32_t count, std::uint32_t now) {
        const std::uint32_t counted = (count_ - count) % most_counts;  // it counts down
        count_ = count;
        at_ += counted * count_ns + change_ns;
        while (before(now) > wrap_ns - clock_step) at_ += wrap_ns;
        if (before(now) < -clock_step) at_ -= wrap_ns;
        since_sample_ = counted == 1 ? count_ns + change_ns : count_ns;
    }

    /// So many words are left out.
    void skip(std::uint32_t words) { at_ += words * change_ns; }

    /// There is no word. Not so far that the next one would seem to come later than it does.
    void pass(std::uint32_t now) {
        while (before(now) > 2 * wrap_ns) at_ += wrap_ns;
    }

    /// When the line changed that the newest sample was the first to show: between that sample and
    /// the one before, on average in the middle.
    std::uint32_t edge() const { return at_ - synchroniser_cycles * cycle_ns - since_sample_ / 2; }

 private:
    static constexpr std::uint32_t cycle_ns = 8;
    /// A sample shows the level that the first flip-flop of the synchroniser took in so long before
    /// the cycle of the sample began; the second one had it when that cycle began.
    static constexpr std::uint32_t synchroniser_cycles = 1;
    static constexpr std::uint32_t count_ns = watcher::sample_cycles * cycle_ns;
    static constexpr std::uint32_t change_ns = watcher::change_cycles * cycle_ns;
    static constexpr std::uint32_t most_counts = 1U << watcher::count_bits;
    /// After that time the counts are the same again.
    static constexpr std::int32_t wrap_ns = most_counts * count_ns;
    static_assert(oldest < wrap_ns);
    /// Largest disagreement of sample and clock. If lower, a word that has just come seems to be of
    /// 50 ms before; if higher, a word has to be looked at 2 us earlier.
    static constexpr std::int32_t clock_step = 2'000;

    std::int32_t before(std::uint32_t now) const { return static_cast<std::int32_t>(now - at_); }

    // One word before the first.
    std::uint32_t at_ = watcher::first_sample * cycle_ns - count_ns - change_ns;
    std::uint32_t since_sample_ = 0;
    std::uint32_t count_ = 0;
};

}  // namespace versavis::rp2040
