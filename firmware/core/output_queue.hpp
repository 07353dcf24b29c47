// SPDX-License-Identifier: BSD-3-Clause
// Edges of all outputs in one order: what was decided for each output, merged into words for the hardware.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal.hpp"

namespace versavis::firmware {

class OutputQueue {
 public:
    explicit OutputQueue(OutputSchedule& hardware) : hardware_(hardware) {}

    /// True while both edges of a pulse can be set.
    bool has_room() const { return size_ + 2 <= capacity; }

    /// Sets the level of `output` at `at`, or as soon as possible after what was already committed. Returns
    /// the instant. Without room nothing is set.
    Nanoseconds set(Nanoseconds at, unsigned output, bool level);

    /// Hands to the hardware what is due before `until`.
    void commit(Nanoseconds until);

    /// Instant of the first edge that is not committed; INT64_MAX: none.
    Nanoseconds next() const { return size_ == 0 ? INT64_MAX : edges_[0].at; }

    /// Removes the edges of `output` that are not committed; its level goes to `idle` at once.
    void cancel(unsigned output, bool idle, Nanoseconds now);

    std::size_t high_water() const { return high_water_; }

 private:
    struct PendingEdge {
        Nanoseconds at;
        std::uint8_t output;
        bool level;
    };
    static constexpr std::size_t capacity = 32;  // 4 outputs x 2 edges x 3 triggers ahead, with room

    OutputSchedule& hardware_;
    PendingEdge edges_[capacity] = {};
    std::size_t size_ = 0;
    std::size_t high_water_ = 0;
    Nanoseconds committed_until_ = INT64_MIN;
    std::uint32_t levels_ = 0;
};

}  // namespace versavis::firmware
