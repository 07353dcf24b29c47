// SPDX-License-Identifier: BSD-3-Clause
// Frames in, a report on the LED timing board out: of a recording, or of frames as they come.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "evaluate/led_report.hpp"
#include "recording/recording.hpp"
#include "versavis/metadata.hpp"

namespace versavis::client {

struct LedEvaluationSettings {
    LedReportSettings report;
    std::map<std::string, LedPlace> places{};     ///< where the board is not to be looked for
    std::map<std::string, Duration> exposures{};  ///< instead of those that were measured
};

/// First look() at some frames of each camera, then find(), then add() all.
class LedEvaluation {
 public:
    /// Frames of a camera in which the board is looked for. If lower, a scene that moves slowly
    /// looks like LEDs.
    static constexpr unsigned enough_frames = 40;

    explicit LedEvaluation(LedEvaluationSettings settings) : settings_(std::move(settings)) {}

    /// Errors: as of grey_picture().
    Expected<> look(const std::string& camera, const FrameMetadata& frame,
                    std::span<const std::byte> pixels);
    /// Nothing is gained from more frames of this camera.
    bool looked_enough(const std::string& camera) const;
    /// Cameras that do not see the board are left out, unless `required` names them. Error: of
    /// these, or of all.
    Expected<> find(const std::vector<std::string>& required);

    /// Frames of other cameras, and those that are suspect, are passed over.
    Expected<> add(const std::string& camera, std::uint64_t life, OutputTime time,
                   const FrameMetadata& frame, std::span<const std::byte> pixels);
    Expected<LedReport> report() const;

    const std::map<std::string, LedPlace>& places() const { return settings_.places; }

 private:
    LedEvaluationSettings settings_;
    std::map<std::string, LedSearch> searches_;
    std::map<std::string, Error> not_found_;
    LedObservations shots_;
};

/// Of the cameras named; none named: of all that see the board. `progress` gets the number of
/// frames that were read. Errors: of the recording, of a name that is no camera of it, and those
/// above.
Expected<LedReport> evaluate_leds(const Recording& recording,
                                  const std::vector<std::string>& cameras,
                                  const LedEvaluationSettings& settings,
                                  const std::function<bool(std::size_t frames)>& progress);

/// Steps per second, from the configuration that the recording holds; 0: it does not say.
double recorded_led_rate_hz(const Recording& recording);

}  // namespace versavis::client
