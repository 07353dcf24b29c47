// SPDX-License-Identifier: BSD-3-Clause
// Where a recording must be cut so that what is exported is continuous.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::client {

/// Stamps of one life of the service and of one epoch can be compared.
struct Continuity {
    std::uint64_t life = 0;
    std::uint32_t epoch = 0;

    friend bool operator==(const Continuity& a, const Continuity& b) {
        return a.life == b.life && a.epoch == b.epoch;
    }
    friend bool operator<(const Continuity& a, const Continuity& b) {
        return std::tie(a.life, a.epoch) < std::tie(b.life, b.epoch);
    }
};

struct SequenceBounds {
    static constexpr OutputTime earliest{std::numeric_limits<std::int64_t>::min()};
    static constexpr OutputTime latest{std::numeric_limits<std::int64_t>::max()};

    Continuity continuity;
    OutputTime first = earliest;  ///< of samples; frames lie in between
    OutputTime last = latest;
    bool joined = false;  ///< stamps of any life and epoch belong to it
    std::string cause;    ///< why it does not continue the one before; empty: it is the first

    bool fits(const Continuity& one) const { return joined || one == continuity; }
    bool has(const Continuity& one, OutputTime time) const {
        return fits(one) && first < time && time < last;
    }
    Duration length() const;
};

struct TimedSample {
    OutputTime time;
    Continuity continuity;
};

/// Sequences in which each of the IMUs that have samples has no hole: 40 ms or five of its periods
/// without any, whichever is longer. Those shorter than a second are left out where others are
/// longer. `frames` says where there is one if no IMU has samples. `join`: one sequence over all.
std::vector<SequenceBounds> find_sequences(const std::vector<std::vector<TimedSample>>& imus,
                                           const std::vector<TimedSample>& frames, bool join);

}  // namespace versavis::client
