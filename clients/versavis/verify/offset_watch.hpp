// SPDX-License-Identifier: BSD-3-Clause
// Whether the pictures of a camera still belong to its stamps, while both go on.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "base/picture_offset.hpp"

namespace versavis::client {

/// Pictures and stamps differ from what is usual.
struct Departure {
    Duration by;
    Duration sigma;
    OutputTime since;
};

/// Learns the usual offset between the pictures of one camera and a gyro from the first stretches,
/// and alarms when two stretches or more depart from it together. What shutter and filters delay
/// does not change, so what was learned stays: a slow drift is found as well as a step.
class OffsetWatch {
 public:
    /// `calibrated`: as Kalibr found it; the usual offset must not be another.
    explicit OffsetWatch(std::optional<Duration> calibrated = {}) : calibrated_(calibrated) {}

    void add(const PictureOffset& offset);

    /// None: still learning.
    const std::optional<PictureOffset>& usual() const { return usual_; }
    const std::optional<Departure>& departure() const { return departure_; }

 private:
    double sigmas(const PictureOffset& offset) const;
    double scatter() const;
    void settle();
    void learn(const PictureOffset& offset);
    std::optional<Departure> departing() const;
    bool agrees_again() const;

    std::optional<Duration> calibrated_;
    std::vector<PictureOffset> learned_;
    std::optional<PictureOffset> usual_;
    std::deque<PictureOffset> latest_;  ///< that were not judged yet, or depart
    std::deque<double> changes_;        ///< from one earlier one to the next, in sigmas
    std::optional<Departure> departure_;
};

}  // namespace versavis::client
