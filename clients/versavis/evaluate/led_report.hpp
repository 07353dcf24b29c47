// SPDX-License-Identifier: BSD-3-Clause
// What the readings of an LED timing board say about cameras that should expose together: pairs,
// increments against stamps, and offsets within a step.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "evaluate/led_count.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// A picture, and what the service published of it.
struct LedObservation {
    std::uint64_t life = 0;
    std::uint32_t epoch = 0;
    std::uint64_t tick = 0;
    bool triggered = true;  ///< else the tick says nothing
    OutputTime time;        ///< middle of the exposure
    Duration exposure;
    LedPicture picture;
};

struct LedReportSettings {
    double rate_hz = 1000;                       ///< steps of the board per second
    LedLayout layout;                            ///< binary_first is found out for each camera
    std::map<std::string, bool> binary_first{};  ///< cameras where it is known
};

struct LedCameraReport {
    std::string name;
    std::size_t pictures = 0;
    std::size_t read = 0;
    std::size_t ambiguous = 0;
    std::size_t saturated = 0;  ///< read for their count only
    std::size_t hidden = 0;
    std::size_t too_long = 0;     ///< of more steps than can be read, or of unknown exposure
    std::size_t split = 0;        ///< a step fell into the exposure: read to parts of a step
    std::size_t untriggered = 0;  ///< in no pair
    std::size_t increments = 0;
    std::size_t wrong_increments = 0;  ///< do not fit the stamps
    double scatter_us = 0;             ///< RMS of readings against stamps, where they are split
    double rate_hz = 0;  ///< steps per second of the stamps' clock; 0: too few readings
    bool binary_first = false;
};

struct LedPairReport {
    std::string first;
    std::string second;
    std::size_t pairs = 0;
    std::size_t matches = 0;
    std::size_t modulo_32 = 0;  ///< of these, where a count may as well be 32 later
    std::size_t mismatches = 0;
    std::size_t ambiguous = 0;
    std::size_t split = 0;    ///< pairs that are read to parts of a step
    double offset_us = 0;     ///< how much later the second really exposed than its stamps say
    double interval_us = 0;   ///< half the 95 % confidence interval of that; of a few: infinite
    double deviation_us = 0;  ///< of a single pair
    double largest_us = 0;    ///< of all pairs
};

struct LedReport {
    double rate_hz = 0;
    std::vector<LedCameraReport> cameras;
    std::vector<LedPairReport> pairs;
    std::vector<std::string> notes;  ///< what these pictures cannot show, and what looks wrong

    std::size_t pictures_read() const;
    bool ok() const;  ///< there are pairs, all match, and all increments fit
};

/// Shots of each camera, in the order of their stamps.
using LedObservations = std::map<std::string, std::vector<LedObservation>>;

/// Error: no camera, or no picture could be read, with the reason.
Expected<LedReport> led_report(const LedObservations& shots, const LedReportSettings& settings);

std::string to_text(const LedReport& report);
nlohmann::json to_json(const LedReport& report);

}  // namespace versavis::client
