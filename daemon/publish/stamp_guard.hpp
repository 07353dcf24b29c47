// SPDX-License-Identifier: BSD-3-Clause
// Keeps the published stamps of one stream from going backwards within an epoch.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "engine/clock/translator.hpp"
#include "versavis/metadata.hpp"

namespace versavis::daemon {

/// What is published: sigma and flags are those of this time.
struct GuardedStamp {
    OutputTime time;
    std::uint32_t sigma_ns = 0;
    std::uint32_t flags = 0;
};

class StampGuard {
 public:
    /// The stamp as it is, or held just after the one before by no more than its sigma explains.
    /// None: it lies further back and cannot be published in this epoch. Suspect stamps are no
    /// measure for others, nor others for them.
    std::optional<GuardedStamp> guard(const clock::Stamp& stamp, std::uint32_t sigma_ns,
                                      bool suspect = false) {
        using clock::ClockState;
        GuardedStamp guarded{stamp.output, sigma_ns, 0};
        if (stamp.state == ClockState::holdover || stamp.state == ClockState::step)
            guarded.flags |= flag_holdover;
        if (stamp.second_doubted) guarded.flags |= flag_second_doubted;
        if (suspect) return guarded;
        if (last_ && epoch_ == stamp.epoch && stamp.output <= *last_) {
            guarded.time = *last_ + nanoseconds(1);
            if (!explained(guarded.time - stamp.output, sigma_ns)) {
                ++refused_;
                return std::nullopt;
            }
            guarded.sigma_ns = widened(sigma_ns, guarded.time - stamp.output);
            guarded.flags |= flag_clamped;
        }
        refused_ = 0;
        last_ = guarded.time;
        epoch_ = stamp.epoch;
        return guarded;
    }

    /// So many in a row were refused that the last one published must have been wrong.
    bool stuck() const { return refused_ >= refusals_to_doubt; }

 private:
    /// Sigmas that a stamp may be held by.
    static constexpr std::int64_t most_sigmas = 3;

    static constexpr int refusals_to_doubt = 3;

    static bool explained(Duration hold, std::uint32_t sigma_ns) {
        return sigma_ns == sigma_unknown || hold.ns <= most_sigmas * sigma_ns;
    }
    static std::uint32_t widened(std::uint32_t sigma_ns, Duration hold) {
        if (sigma_ns == sigma_unknown) return sigma_unknown;
        const double sigma = std::hypot(sigma_ns, static_cast<double>(hold.ns));
        return static_cast<std::uint32_t>(std::min<double>(std::ceil(sigma), sigma_unknown - 1));
    }

    std::optional<OutputTime> last_;
    std::uint32_t epoch_ = 0;
    int refused_ = 0;
};

}  // namespace versavis::daemon
