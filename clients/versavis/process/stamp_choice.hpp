// SPDX-License-Identifier: BSD-3-Clause
// Decides which stamps of a recording are replaced: only those that the recomputed clock improves.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "process/restamping.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

enum class Choice {
    improved,     ///< the recomputed stamp is better
    other_clock,  ///< PPS made the live one, or a reading of the output clock that is not recorded
    disagrees,    ///< the two differ by more than both sigmas explain: one of them is wrong
    no_better,    ///< sigma of the clock would not be smaller
    no_estimate,  ///< no messages around it, or a clock was stepped there
    no_clock,     ///< no stamp by the clock: of the arrival, suspect, or paired otherwise now
};

/// Standard deviation of the clock alone, as the service had it.
class LiveSigmas {
 public:
    void add(HostTime at, Duration sigma) { known_.push_back({at, sigma}); }
    void sort();

    /// The smaller one of those before and after, within two seconds; none: it is not known.
    std::optional<Duration> at(HostTime at) const;

    /// The smallest of all.
    std::optional<Duration> least() const;

 private:
    struct Known {
        HostTime at;
        Duration sigma;
    };
    std::vector<Known> known_;
};

/// A stamp as the service made it.
struct LiveStamp {
    OutputTime time;
    HostTime host;
    Duration least_sigma;  ///< of the clock alone, at least ...
    Duration most_sigma;   ///< ... and at most
    bool held = false;     ///< so that it did not go back: its time is not that of the clock
};

/// It differs from what the service made of the messages and the output clock.
bool by_other_clock(const LiveStamp& live, const Restamping& restamping);

Choice choose(const LiveStamp& live, const std::optional<Restamping::Stamp>& better,
              const Restamping& restamping);

/// Of one stream, in the order of time. By chance, a single stamp agrees with anything: those
/// around others of another clock, or that disagree, are not replaced either.
struct DatedChoice {
    HostTime at;
    Choice choice;
};
void spread(std::vector<DatedChoice>& choices);

}  // namespace versavis::client
