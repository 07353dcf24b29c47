// SPDX-License-Identifier: BSD-3-Clause
// Length of the newest exposures by the camera's own events of their start and end.
#pragma once

#include <array>
#include <cstdint>

#include "versavis/time.hpp"

namespace versavis::daemon {

/// Not thread-safe. Block ids may have 16 bits, which wrap from 65535 to 1.
class EventLengths {
 public:
    void started(std::uint64_t block_id, CameraTime at) { of(block_id) = {block_id, at, {}}; }
    void ended(std::uint64_t block_id, CameraTime at) {
        if (of(block_id).block_id == block_id) of(block_id).end = at;
    }

    /// 0: start or end are unknown, or contradict each other.
    Duration length(std::uint64_t block_id) const {
        for (const Entry& entry : entries_) {
            const bool its = entry.block_id != 0 && entry.block_id % wrap == block_id % wrap;
            if (its && entry.end > entry.start) return entry.end - entry.start;
        }
        return {};
    }

 private:
    static constexpr std::uint64_t wrap = 65535;

    /// More than frames wait for their pair.
    static constexpr std::size_t remembered = 64;

    struct Entry {
        std::uint64_t block_id = 0;
        CameraTime start;
        CameraTime end;
    };

    Entry& of(std::uint64_t block_id) { return entries_[block_id % remembered]; }

    std::array<Entry, remembered> entries_{};
};

}  // namespace versavis::daemon
