// SPDX-License-Identifier: BSD-3-Clause
// The frames of a recorded camera with the time marks that a GNSS receiver made of its pulses.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "gnss/mark_match.hpp"
#include "gnss/ubx_marks.hpp"
#include "recording/recording.hpp"

namespace versavis::client {

struct GnssMatchSettings {
    std::string camera{};  ///< empty: the only one
    MarkEdge edge = MarkEdge::rising;
    unsigned channel = 0;  ///< EXTINT pin
    /// The receiver's GNSS time less UTC; none: it is not known of which system it is.
    std::optional<int> leap_seconds{};
};

/// Frames of one run of the service between two steps of its clocks.
struct GnssSequence {
    std::uint64_t life = 0;
    std::uint32_t epoch = 0;
    std::uint64_t frames = 0;
    MarkMatch match{};
    std::string failure{};  ///< why there is no match
    /// Mark less stamp, its mean and what it varies by (rms). Of GNSS time without leap seconds, as
    /// if it were UTC.
    Duration offset{};
    Duration spread{};
};

struct MarkedFrame {
    OutputTime time;
    std::uint64_t number = 0;
    std::uint64_t life = 0;
    std::uint64_t trigger = 0;
    TimeMark mark;
};

struct GnssMatchReport {
    std::string camera;
    std::uint64_t suspect = 0;  ///< frames left out
    std::uint64_t marks = 0;    ///< of this edge and channel, in one time base
    std::uint64_t invalid = 0;  ///< marks left out, as the receiver did not know the time
    std::uint64_t missed = 0;   ///< edges that it counted without a mark
    std::uint64_t damaged = 0;  ///< messages
    TimeBase base = TimeBase::gnss;
    std::vector<GnssSequence> sequences;
    std::vector<MarkedFrame> frames;
};

/// Errors: no such camera; no marks. A sequence without a match says why.
Expected<GnssMatchReport> match_gnss(const Recording& recording, const UbxMarks& marks,
                                     const GnssMatchSettings& settings);

std::string to_text(const GnssMatchReport& report);
nlohmann::ordered_json to_json(const GnssMatchReport& report);

/// A row per frame: stamp, number, life, trigger, GPS week and time of week, accuracy.
std::string to_csv(const GnssMatchReport& report);

}  // namespace versavis::client
