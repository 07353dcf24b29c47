// SPDX-License-Identifier: BSD-3-Clause
// The newest edges of a data-ready line, without its echoes: which one came before a reading.
#pragma once

#include "base/hal.hpp"

namespace versavis::firmware {

class ReadyEdges {
 public:
    /// Edges closer than an eighth of the part's period to the one before are echoes of it, but at
    /// most 100 us: a part that reset itself and runs faster is to be noticed.
    void configure(Nanoseconds period) {
        count_ = known_ = echoes_ = 0;
        width_ = period / 8 < longest_echo ? period / 8 : longest_echo;
    }

    /// False: an echo.
    bool add(Nanoseconds at) {
        if (count_ > 0 && at - newest() < width_) {
            ++echoes_;
            return false;
        }
        stamps_[count_++ % kept] = at;
        if (known_ != kept) ++known_;
        return true;
    }

    /// Some edges were not passed on: those from before say nothing about what is read from here
    /// on.
    void forget() { known_ = 0; }

    /// Edges so far, modulo 2^32.
    std::uint32_t count() const { return count_; }
    Nanoseconds newest() const { return stamps_[(count_ - 1) % kept]; }
    /// Edges up to this instant are echoes of the newest one.
    Nanoseconds quiet_until() const { return count_ == 0 ? 0 : newest() + width_ - 1; }

    /// The newest edge not after `at`. False: none of those that are kept.
    bool find(Nanoseconds at, Nanoseconds& stamp, std::uint32_t& number) const {
        for (std::uint32_t back = 0; back < known_; ++back) {
            number = count_ - back;
            stamp = stamps_[(number - 1) % kept];
            if (stamp <= at) return true;
        }
        return false;
    }

    /// The edge after one that was found. False: none has come.
    bool next(std::uint32_t number, Nanoseconds& stamp) const {
        stamp = stamps_[number % kept];
        return number != count_;
    }

    std::uint32_t take_echoes() {
        const std::uint32_t echoes = echoes_;
        echoes_ = 0;
        return echoes;
    }

 private:
    /// If lower, a poll that is held up for a millisecond at 8 kHz loses a sample's stamp; if
    /// higher, memory is wasted.
    static constexpr std::uint32_t kept = 16;
    /// If lower, a line with long reflections counts double; if higher, parts at 4 kHz lose edges.
    static constexpr Nanoseconds longest_echo = 100'000;

    Nanoseconds width_ = 0;
    std::uint32_t count_ = 0;
    std::uint32_t known_ = 0;  ///< of the newest of them
    std::uint32_t echoes_ = 0;
    Nanoseconds stamps_[kept] = {};
};

}  // namespace versavis::firmware
