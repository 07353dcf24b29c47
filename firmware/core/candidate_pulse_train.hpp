// SPDX-License-Identifier: BSD-3-Clause
// Pulses that do not fit the train being followed: if they fit each other, they are followed
// instead.
#pragma once

#include "base/hal.hpp"

namespace versavis::firmware {

class CandidatePulseTrain {
 public:
    /// Pulses that must agree. If lower, an echo is followed; if higher, a sender that restarted is
    /// ignored for longer.
    static constexpr unsigned enough = 3;

    void clear() { count_ = 0; }

    /// Adds a pulse that does not fit. True: it is the last of `enough` that are whole periods
    /// apart, each to one part in `tolerance`.
    bool add(Nanoseconds at, Nanoseconds period, Nanoseconds tolerance) {
        const Nanoseconds gap = at - newest_;
        const Nanoseconds periods = count_ == 0 ? 0 : (gap + period / 2) / period;
        const Nanoseconds off = gap - periods * period;
        const Nanoseconds allowed = periods * (period / tolerance);
        if (periods < 1 || periods > longest_gap || off > allowed || -off > allowed) {
            count_ = 1;
            first_ = at;
            periods_ = 0;
        } else {
            ++count_;
            periods_ += periods;
        }
        newest_ = at;
        return count_ >= enough;
    }

    Nanoseconds first() const { return first_; }
    Nanoseconds newest() const { return newest_; }
    /// From first() to newest().
    Nanoseconds periods() const { return periods_; }

 private:
    /// In periods. If lower, a receiver that drops pulses is found later; if higher, noise agrees
    /// more easily.
    static constexpr Nanoseconds longest_gap = 4;

    unsigned count_ = 0;
    Nanoseconds first_ = 0;
    Nanoseconds newest_ = 0;
    Nanoseconds periods_ = 0;
};

}  // namespace versavis::firmware
