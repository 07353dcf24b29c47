// SPDX-License-Identifier: BSD-3-Clause
// Between which host times an instant of the board must lie, by causality alone: no message is
// received before it is sent. Nothing is estimated, so no delay, filter or asymmetry of the link
// can make these bounds wrong.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "verify/recorded_evidence.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// One boot of the board. Each exchange and each message bounds the difference of the two clocks;
/// within a few seconds both clocks run evenly, so that all bounds there apply to one line. The
/// largest set of bounds that agree counts (Marzullo, "Maintaining the time in a distributed
/// system", 1984): a message with impossible stamps bounds nothing.
class ClockBounds {
 public:
    struct Interval {
        HostTime earliest;
        HostTime latest;

        /// By how much `at` lies outside; negative: before.
        Duration outside(HostTime at) const;
    };

    ClockBounds(std::vector<ClockExchange> exchanges, std::vector<ClockMessage> messages);

    /// None: no exchange within some seconds, or they contradict each other.
    std::optional<Interval> at(BoardTime board) const;

    /// They contradict each other around this instant.
    bool contradictory(BoardTime board) const;

    /// From the first exchange sent to the last one that arrived.
    HostTime begin() const { return begin_; }
    HostTime end() const { return end_; }
    std::uint64_t exchanges() const { return exchange_count_; }
    std::uint64_t refused_exchanges() const { return refused_; }
    Duration usual_width() const;  ///< of an interval

 private:
    struct Block {
        bool agree = false;
        double slope = 0;
        Duration lowest;  ///< host minus board, at the middle of the block
        Duration highest;
    };
    struct Bound {
        BoardTime at;
        Duration lowest;
        Duration highest;
    };

    void make_block(std::int64_t number, const std::vector<Bound>& quickest);
    double slope_around(BoardTime at, const std::vector<Bound>& quickest, double& error) const;
    const Block* block(BoardTime at) const;

    std::vector<ClockExchange> exchanges_;
    std::vector<ClockMessage> messages_;
    std::map<std::int64_t, Block> blocks_;  ///< by the second of the board's clock
    HostTime begin_;
    HostTime end_;
    std::uint64_t exchange_count_ = 0;
    std::uint64_t refused_ = 0;
};

}  // namespace versavis::client
