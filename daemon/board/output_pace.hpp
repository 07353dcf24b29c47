// SPDX-License-Identifier: BSD-3-Clause
// By how much board time passes faster than the output clock.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "engine/clock/translator.hpp"

namespace versavis::daemon {

/// From the estimate of the board's clock against the host's, and from readings of the output
/// clock, one a second, since that may be slewed against the host's. Not thread-safe.
class OutputPace {
 public:
    /// In parts per billion; none: more than the board takes.
    std::optional<std::int32_t> add(const clock::BoardSecond& second);

 private:
    struct Offset {
        HostTime host;
        Duration output_minus_host;
    };

    double slewed() const;

    std::optional<std::uint32_t> epoch_;
    std::deque<Offset> offsets_;  ///< of the last seconds, in one epoch
};

}  // namespace versavis::daemon
