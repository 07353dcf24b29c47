// SPDX-License-Identifier: BSD-3-Clause
// Which time mark of a GNSS receiver belongs to which frame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// By what the marks were given to frames.
enum class MatchProof {
    none,     ///< they were not
    labels,   ///< the receiver named seconds that were recorded: the two clocks are known
    pattern,  ///< their gaps fit in one way only
};
const char* to_string(MatchProof proof);

struct MarkableFrame {
    OutputTime time;
    std::uint64_t trigger;  ///< counts the pulses
};

struct MatchedMark {
    std::size_t frame;
    std::size_t mark;
};

struct MarkMatch {
    MatchProof proof = MatchProof::none;
    std::vector<MatchedMark> pairs{};  ///< in order
};

/// The receiver's clock less the output clock, at an output time.
struct ClockRelation {
    OutputTime at;
    Duration offset;
};

/// `frames` and `marks`: instants of one camera's exposures and of the pulses that were sent with
/// them, each in order and on a clock of its own; some of both may be missing. `relation`: in
/// order, where the clocks were compared; none: only the pattern of the gaps can tell.
///
/// By the pattern, stretches of marks with uneven gaps are laid on each stretch of the pulses that
/// frames and their trigger numbers show. One must fit in one place clearly better than in all
/// others. From there, or from the relation, pairs are followed in both directions, while the
/// clocks may drift.
///
/// Errors: nothing fits, or it fits in several ways.
Expected<MarkMatch> match_marks(std::span<const MarkableFrame> frames,
                                std::span<const Duration> marks,
                                std::span<const ClockRelation> relation);

}  // namespace versavis::client
