// SPDX-License-Identifier: BSD-3-Clause
// The camera's clock against the board's, and which instant of the exposure the camera stamps.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "engine/pairing/exposure_log.hpp"
#include "engine/pairing/relation.hpp"

namespace versavis::pairing {

/// Until it is known which instant a camera stamps, each one is followed. When the length of the
/// exposure changes, they part: the stamp moves by none, half or all of the change.
class CameraClock {
 public:
    /// `stamped`: unknown, it is found out.
    explicit CameraClock(Instant stamped) : stamped_(stamped) {}

    Instant stamped() const { return stamped_; }

    /// All that the camera may stamp, by what was seen so far.
    std::span<const Instant> possible() const;

    std::int64_t expected_instant_ns(Instant instant, CameraTime time) const;
    std::int64_t tolerance_ns(Instant instant, CameraTime time) const;

    void track(CameraTime time, const Record& record);

    /// Another difference from here on: the camera's clock stepped. The rate stays.
    void move(CameraTime time, const Record& record);

    /// Nothing is known of the difference any more, but which instant is stamped.
    void forget();

 private:
    struct Pair {
        CameraTime time;
        Record record;
    };

    void learn(const Pair& now);

    Relation& relation(Instant instant);
    const Relation& relation(Instant instant) const;

    Instant stamped_;
    std::array<Relation, 3> relations_{Relation(true), Relation(true), Relation(true)};
    std::optional<Pair> last_;  ///< that was measured, since the clock was last unsteady
    Instant voted_ = Instant::unknown;
    int votes_ = 0;  ///< in a row
};

/// True when the board saw this instant, or it follows from what it saw.
bool seen(const Exposure& exposure, Instant instant);

}  // namespace versavis::pairing
