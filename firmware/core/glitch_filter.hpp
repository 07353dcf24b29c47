// SPDX-License-Identifier: BSD-3-Clause
// An exposure line whose contacts bounce or that picks up spikes: which of its edges count.
#pragma once

#include "base/hal.hpp"

namespace versavis::firmware {

/// A new level counts once the line has kept it for `width`, from the first edge towards it: what
/// bounces begins with its first edge. A level that is left again sooner was a glitch.
class GlitchFilter {
 public:
    void configure(Nanoseconds width) {
        *this = {};
        width_ = width;
    }

    /// An edge of the line; edges come in order, each after take() for its instant.
    void edge(Nanoseconds at, bool level) {
        if (pending()) {
            ++left_out_;
        } else {
            first_ = at;
            level_ = !level;  // also if it was so before: then the edge in between was missed
        }
        line_ = level;
        newest_ = at;
    }

    /// True, once, when all edges before `settled` are known and a level has lasted: it counts from
    /// `at` on.
    bool take(Nanoseconds settled, Nanoseconds& at, bool& level) {
        if (!pending() || settled < newest_ + width_) return false;
        at = first_;
        first_ = never;
        const bool certain = !edges_lost_;
        edges_lost_ = false;
        if (certain && line_ == level_) {
            ++left_out_;
            return false;
        }
        level = level_ = line_;
        return certain;
    }

    /// The next level does not count: the first edge towards it may be among the lost ones.
    void edges_lost() {
        first_ = never;
        edges_lost_ = true;
    }

    /// Before this instant nothing more will count.
    Nanoseconds settled(Nanoseconds settled) const { return first_ < settled ? first_ : settled; }

    /// When take() has something to say; never: nothing is pending.
    Nanoseconds next_wake() const { return pending() ? newest_ + width_ : never; }

    /// Edges that were left out, since the last call.
    std::uint32_t take_left_out() {
        const std::uint32_t count = left_out_;
        left_out_ = 0;
        return count;
    }

 private:
    bool pending() const { return first_ != never; }

    Nanoseconds width_ = 0;
    bool level_ = false;         ///< that counts
    bool line_ = false;          ///< of the newest edge
    Nanoseconds first_ = never;  ///< edge towards a level that does not count yet
    Nanoseconds newest_ = 0;
    bool edges_lost_ = false;  ///< since a level was known
    std::uint32_t left_out_ = 0;
};

}  // namespace versavis::firmware
