// SPDX-License-Identifier: BSD-3-Clause
// Board time to host time of a recording: what all of its messages, earlier and later ones, say
// together.
#pragma once

#include <optional>
#include <vector>

#include "engine/clock/asymmetry.hpp"
#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/gaussian_state.hpp"
#include "engine/clock/messages.hpp"

namespace versavis::clock {

/// The model of EnvelopeFilter, solved forward and backward (H. Rauch, F. Tung, C. Striebel,
/// Maximum likelihood estimates of linear dynamic systems, 1965) several times, since each pass
/// weighs each message better (expectation propagation). Where the filter restarted, at a step or a
/// reset, a new segment begins. Used by one thread, after recording.
class Smoother {
 public:
    /// In the order in which they became available. `asymmetry`: of the link, if it was measured.
    explicit Smoother(const std::vector<Message>& messages,
                      const std::optional<Asymmetry>& asymmetry = {});

    /// Of the segment that holds `board`, or else the one that begins last before it. State: locked
    /// within 3 s of the messages of the segment, holdover beyond, init when there were none; step
    /// where one segment ended and the next had not begun: a clock was stepped somewhere there.
    HostEstimate translate(BoardTime board) const;

    std::size_t segments() const { return segments_.size(); }

 private:
    struct SmootherStep {
        EdgeSite site;
        double precision =
            0;  ///< what the message says about the level of its edge, in natural parameters
        double precision_mean = 0;
        double presumed_asymmetry_ns = 0;  ///< as the shape of the delays around it says
        GaussianState filtered;
        GaussianState smoothed;
    };
    struct Segment {
        Duration base;
        Duration first_round_trip;
        BoardTime begin;
        BoardTime end;
        std::vector<SmootherStep> steps;
    };

    static Segment begin(const std::vector<EdgeSite>& sites, std::size_t first, std::size_t last);
    static void pass_forth(Segment& segment, bool first);
    static void pass_back(Segment& segment);
    static bool earlier(const SmootherStep& a, const SmootherStep& b);
    static void thin(Segment& segment);
    static void rescale(Segment& segment, Direction direction);
    static void weigh(Segment& segment);
    static void presume_asymmetry(Segment& segment);
    static std::vector<double> overshoots(const std::vector<double>& delays_ns);
    static void judge(SmootherStep& step, double level_ns, double mean, double variance,
                      double share);
    static double level_ns(const Segment& segment, const SmootherStep& step);

    const Segment* segment_of(BoardTime board) const;

    std::vector<Segment> segments_;
    std::optional<Asymmetry> asymmetry_;
};

}  // namespace versavis::clock
