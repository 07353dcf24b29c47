// SPDX-License-Identifier: BSD-3-Clause
// Exposures that the host announced for triggers to come.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/hal.hpp"

namespace versavis::firmware {

struct Announcement {
    std::uint64_t trigger;  ///< applies from this one on
    Nanoseconds exposure;
    bool clipped;
};

/// In the order of their triggers; at most eight, beyond that the furthest is dropped.
class Announcements {
 public:
    void clear() { count_ = 0; }

    /// Replaces announcements for the same or later triggers.
    void add(const Announcement& announcement) {
        while (count_ > 0 && entries_[count_ - 1].trigger >= announcement.trigger) --count_;
        if (count_ == capacity) --count_;
        entries_[count_++] = announcement;
    }

    /// The newest one that applies to `trigger`; null: none does.
    const Announcement* find(std::uint64_t trigger) const {
        const Announcement* found = nullptr;
        for (std::size_t i = 0; i < count_ && entries_[i].trigger <= trigger; ++i)
            found = &entries_[i];
        return found;
    }

    /// Drops what applies to `trigger`: it has been used.
    void used(std::uint64_t trigger) {
        std::size_t taken = 0;
        while (taken < count_ && entries_[taken].trigger <= trigger) ++taken;
        count_ -= taken;
        for (std::size_t i = 0; i < count_; ++i) entries_[i] = entries_[i + taken];
    }

 private:
    static constexpr std::size_t capacity = 8;

    std::size_t count_ = 0;
    Announcement entries_[capacity];
};

}  // namespace versavis::firmware
