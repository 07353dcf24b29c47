// SPDX-License-Identifier: BSD-3-Clause
// How long records take on their way to the host.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/pairing/alignment.hpp"

namespace versavis::pairing {

/// A record cannot reach the host before its exposure has ended, nor much sooner after that than
/// any other. One that comes late says that the link stalls, or that the board's time was set back.
class RecordDelay {
 public:
    explicit RecordDelay(const Limits& limits)
        : period_(limits.period),
          earliest_(limits.earliest_arrival),
          latest_(limits.exposure_wait) {}

    bool too_early(const Exposure& exposure) const;

    /// The board's clock was compared with the host's so often by now, and these exchanges agree
    /// with its estimate, or do not: so late records are the link's, and no step of that clock.
    void compared(std::uint64_t exchanges, bool agree);

    /// The newest good record from here on. One of a silent line says nothing about the link: the
    /// board waits for a start before it sends one.
    void take(const Exposure& exposure);

    /// The newest record reached the host as soon as others did. When it did not, the link stalls
    /// or the board's time was set back: which of them is unknown.
    bool prompt() const { return prompt_; }

    /// The link has caught up: the newest record is of an exposure so long after the last late one
    /// came that it was not held up with that. Until then, a delay of the link cannot be
    /// distinguished from a step of the board's time.
    bool live() const;

    /// By how much the newest record came later than usual, while it is unknown why; 0: it did not.
    Duration late_by() const { return live() ? Duration{} : Duration{late_ns_}; }

    /// How soon records reach the host is learned anew.
    void forget() {
        least_delay_ns_.reset();
        confirmed_ = 0;
        usual_delay_ns_ = quickest;
        late_run_.reset();
    }

 private:
    /// Less than any delay, and far from where differences overflow.
    static constexpr std::int64_t quickest = INT64_MIN / 2;

    std::int64_t tolerance_ns() const;
    double earliest_ns() const;
    void learn(const Exposure& exposure);
    std::int64_t lateness_ns(std::int64_t delay_ns);

    /// Records that came late, one after the other.
    struct LateRun {
        std::uint64_t exchanges = 0;  ///< before it
        std::int64_t least_delay_ns = 0;
    };

    Duration period_;
    Duration earliest_;
    Duration latest_;
    std::optional<Exposure> newest_exposed_;
    std::optional<std::int64_t> least_delay_ns_;  ///< on the way to the host
    int confirmed_ = 0;                           ///< records that took no less, in a row
    std::int64_t usual_delay_ns_ = quickest;      ///< since the link became slower
    std::int64_t late_ns_ = 0;                    ///< the newest, against that
    std::optional<LateRun> late_run_;
    std::optional<std::uint64_t> exchanges_;  ///< none: nobody says
    bool prompt_ = true;
    HostTime late_until_;  ///< when the newest late record came, or the first of all
};

}  // namespace versavis::pairing
