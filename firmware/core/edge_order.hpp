// SPDX-License-Identifier: BSD-3-Clause
// Edges of exposure lines that count, until they can be judged in the order in which they happened.
#pragma once

#include "base/hal.hpp"

namespace versavis::firmware {

/// Lines do not settle in the order of their edges: while one bounces, others go on. What they do
/// waits here until it is known what the first one did.
class EdgeOrder {
 public:
    /// False: there is no room.
    bool add(const Edge& edge) {
        if (count_ == capacity) return false;
        edges_[count_++] = edge;
        return true;
    }

    /// The first one, if it is before `settled`.
    bool take(Nanoseconds settled, Edge& edge) {
        unsigned first = capacity;
        for (unsigned i = 0; i < count_; ++i) {
            if (edges_[i].at >= settled) continue;
            settled = edges_[i].at;
            first = i;
        }
        if (first == capacity) return false;
        edge = edges_[first];
        edges_[first] = edges_[--count_];
        return true;
    }

    void drop(std::uint8_t input) {
        unsigned kept = 0;
        for (unsigned i = 0; i < count_; ++i)
            if (edges_[i].input != input) edges_[kept++] = edges_[i];
        count_ = kept;
    }

    void clear() { count_ = 0; }

 private:
    /// Three cameras begin and end within one bounce, and one of them once more. If lower, bounces
    /// cost records.
    static constexpr unsigned capacity = 8;

    unsigned count_ = 0;
    Edge edges_[capacity] = {};
};

}  // namespace versavis::firmware
