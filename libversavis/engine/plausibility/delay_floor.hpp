// SPDX-License-Identifier: BSD-3-Clause
// How long the messages of one stream take to the host at least, and whether one took as long.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "engine/plausibility/persistence.hpp"
#include "versavis/time.hpp"

namespace versavis {

/// How long a message took on its way, by the time that it names, beside those of its stream that
/// were believed. One that names another time than the true one is off by that much.
enum class Promptness : std::uint8_t {
    not_recorded = 0,  ///< by a service that did not judge it
    unknown = 1,       ///< too few were believed, or the clock is not known well enough
    early = 2,         ///< less than any
    usual = 3,         ///< as long as the quickest
    late = 4,          ///< longer: it waited somewhere, or names too early a time
};

/// How far the delay of a usual message may be off the shortest, beside the error of the clock, for
/// which there is as much at most.
constexpr Duration usual_delay_tolerance = microseconds(100);

/// Two accounts of an instant are `apart`: how far a usual delay may then be off the shortest. A
/// larger difference needs a less precise clock. If it were a quarter, a step of the clock on a
/// link with long delays would make as many delays usual as early.
inline Duration tolerance_between(Duration apart) {
    return std::max(usual_delay_tolerance, absolute(apart) / 8);
}

/// Two accounts of an instant are `apart`: the delay of the message shows that its own is right.
inline bool arrival_confirms(Promptness promptness, Duration apart) {
    return promptness == Promptness::usual && absolute(apart) > usual_delay_tolerance * 4;
}

/// Whether messages that do not fit those before them took as long as usual. One alone may seem to:
/// if the board's clock stepped forward, one that waited for as long as the step is large. So most
/// of them must. Not thread-safe.
class StepPromptness {
 public:
    void doubted(Promptness promptness) {
        if (promptness == Promptness::early) early_ = std::min(early_ + 1, furthest);
        if (promptness == Promptness::late) late_ = std::min(late_ + 1, furthest);
        if (promptness != Promptness::usual) return;
        early_ = std::max(early_ - 1, -furthest);
        late_ = std::max(late_ - 1, -furthest);
    }
    void believed() { early_ = late_ = 0; }
    bool mostly_early() const { return early_ > 0; }

    /// Exchanges that they must agree for at least, until they prevail. Where most of them are
    /// late, the times that they name may be too early.
    std::uint64_t least_to_prevail() const { return late_ > 0 ? versavis::least_to_prevail : 0; }

 private:
    /// Half: a busy host more often delays so many in a row. Twice: a step that is followed by the
    /// estimate is believed after twice as many messages.
    static constexpr int furthest = 16;

    int early_ = 0;  ///< less those usual
    int late_ = 0;   ///< the same
};

/// Not thread-safe.
class DelayFloor {
 public:
    /// `sigma`: of the clock that `delay` is measured with.
    Promptness of(Duration delay, Duration sigma,
                  Duration tolerance = usual_delay_tolerance) const {
        if (count_ < messages_to_know) return Promptness::unknown;
        const Duration allowed = tolerance + sigma * sigmas;
        if (delay < least_ - allowed) return Promptness::early;
        if (delay > least_ + allowed) return Promptness::late;
        return sigma * sigmas > tolerance ? Promptness::unknown : Promptness::usual;
    }

    /// Of a message that is believed.
    void learn(Duration delay, HostTime received) {
        if (count_ > 0) least_ = least_ + forgotten(received - newest_);
        least_ = count_ == 0 ? delay : std::min(least_, delay);
        newest_ = received;
        count_ = std::min(count_ + 1, messages_to_know);
    }

    void forget() { count_ = 0; }

 private:
    /// 2 us/s: a link that became slower is followed within a minute or so, a stream that drifts by
    /// more is not.
    static Duration forgotten(Duration passed) {
        return std::clamp(passed, Duration{}, seconds(1)) / 500'000;
    }

    static constexpr int messages_to_know = 16;
    static constexpr std::int64_t sigmas = 3;

    Duration least_;
    HostTime newest_;
    int count_ = 0;
};

}  // namespace versavis
