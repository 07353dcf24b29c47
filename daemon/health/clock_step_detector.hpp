// SPDX-License-Identifier: BSD-3-Clause
// Notices that the output clock stepped, and by how much, from one report of the clock to the next.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/clock/translator.hpp"

namespace versavis::daemon {

struct OutputStep {
    Duration before;  ///< output clock minus host clock
    Duration after;
};

class ClockStepDetector {
 public:
    /// None: it did not step since the last look. The clock may be slewed in between: by no more
    /// than 0.5 ms in a second.
    std::optional<OutputStep> see(const clock::ClockReport& report) {
        const OutputStep step{offset_, report.output_minus_host};
        const bool stepped = steps_ && *steps_ != report.output_steps;
        steps_ = report.output_steps;
        offset_ = report.output_minus_host;
        return stepped ? std::optional(step) : std::nullopt;
    }

 private:
    std::optional<std::uint32_t> steps_;
    Duration offset_;
};

}  // namespace versavis::daemon
