// SPDX-License-Identifier: BSD-3-Clause
// The lower edge of one direction's delays: what a message says of the clocks, given how delays
// spread above their minimum.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::clock {

enum class Direction { to_host = 1, to_board = -1 };

/// One message: when it passed the board, and the host's stamp minus the board's.
struct OffsetSample {
    BoardTime at;
    Duration host_minus_board;
};

/// What one delay says of the edge: derivatives of its log-likelihood by the level of the edge, in
/// 1/ns.
struct Influence {
    double score = 0;
    double curvature = 0;  ///< minus the second one; not negative
};

/// `excess`: the delay less the expected edge; `deviation`: by which that edge is uncertain;
/// `scale`: one over the density of delays above the edge; all in ns. A delay is modelled as the
/// edge plus an exponential of this scale, occasionally of a much larger one, blurred by
/// `deviation`: far above the edge it carries next to no information, and below it it is
/// impossible.
Influence influence_of(double excess, double deviation, double scale);

/// The scale of delays, in ns, by how dense the shortest quarter of them is; reorders them. None:
/// there are too few.
std::optional<double> delay_scale(std::vector<double>& delays_ns);

/// The inherent uncertainty of the edge of delays of this scale, in ns.
double edge_blur(double scale_ns);

/// Slots whose shortest delays show how delays spread. Half as many: scale and overshoot scatter by
/// 1.4 times as much. Twice as many: the clocks' wandering blurs them.
constexpr std::size_t remembered_slots = 64;

/// How the shortest delays of slots thin out towards the shortest possible one.
class DelayShape {
 public:
    /// Of the remembered slots, sorted, in ns.
    void add(const std::vector<double>& sorted_ns);

    /// By how much even the shortest delays seen probably exceed the shortest possible one, in ns:
    /// 0 where delays break off sharply, more where they thin out, as those of a host's wake-ups.
    double overshoot_ns() const;

 private:
    std::size_t judged_ = 0;       ///< windows that the next two are averaged over
    double lower_quarter_ns_ = 0;  ///< between the least delay and the one a quarter are below
    double lower_half_ns_ = 0;     ///< and the one half are below
};

/// The delays of one direction: the shortest of the present slot, and how those of the last slots
/// spread.
class DelayEdge {
 public:
    explicit DelayEdge(Direction direction) : direction_(direction) {}

    /// `delay_ns` as the present estimate has it.
    void offer(const OffsetSample& sample, double delay_ns);

    /// The shortest since the last call; none: no message passed.
    std::optional<OffsetSample> take();

    /// Adds to the last slots' shortest; `delay_of(sample)` says how long they took, in ns.
    template <class DelayOf>
    void remember(const OffsetSample& sample, const DelayOf& delay_of) {
        samples_.push_back(sample);
        if (samples_.size() > remembered_slots) samples_.pop_front();
        delays_.clear();
        for (const OffsetSample& p : samples_) delays_.push_back(delay_of(p));
        rescale();
    }

    /// Forgets them all; until there are new ones, delays spread by `scale_ns`.
    void begin(double scale_ns);

    Direction direction() const { return direction_; }
    double sign() const { return static_cast<double>(direction_); }
    double scale_ns() const { return scale_ns_; }

    double overshoot_ns() const { return shape_.overshoot_ns(); }

    /// The least delay of the newest slots; none: there are too few.
    std::optional<double> newest_least_ns() const { return newest_least_ns_; }

 private:
    void rescale();
    void judge_shape();

    Direction direction_;
    std::optional<OffsetSample> shortest_;
    double shortest_ns_ = 0;
    std::deque<OffsetSample> samples_;
    std::vector<double> delays_;  ///< of the samples
    std::vector<double> newest_;
    std::vector<double> sorted_;
    double scale_ns_ = 0;
    std::optional<double> newest_least_ns_;
    DelayShape shape_;
};

}  // namespace versavis::clock
