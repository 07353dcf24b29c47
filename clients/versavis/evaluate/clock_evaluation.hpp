// SPDX-License-Identifier: BSD-3-Clause
// How well the board's clock was translated, from the stamps in a recording: against the smoothed
// estimate, and against PPS where it is there.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "clock/clock_replay.hpp"
#include "engine/clock/recording.hpp"
#include "recording/recording.hpp"

namespace versavis::client {

/// The stamps from one boot of the board: their times are comparable.
struct BoardLife {
    std::uint32_t nonce = 0;
    ClockRecording stamps;
    std::uint64_t exchanges = 0;
};

struct PpsPulse {
    BoardTime board;
    HostTime host;  ///< as published: it shows which boot of the board it is from
    OutputTime published;
    Duration sigma;  ///< as published; < 0: unknown
};

/// Lives of the board overlap in board time, not in host time. If lower, a guess of a suspect frame
/// that is off by seconds is not taken; if higher, restarts within seconds could be mixed up.
inline constexpr Duration same_life = seconds(2);

/// What a recording holds of the clocks.
struct RecordedClocks {
    std::vector<BoardLife> lives;
    std::vector<clock::RecordedOutput> outputs;
    std::vector<PpsPulse> pulses;  ///< those that nobody doubted
    bool labelled = false;         ///< a receiver named seconds
};

Expected<RecordedClocks> read_clocks(const Recording& recording,
                                     const std::function<bool()>& go_on);

/// The output clock against the host clock at an instant, between the two readings around it, which
/// must be of one epoch. None: before the first, or 2 s after the last.
std::optional<Duration> output_minus_host(const std::vector<clock::RecordedOutput>& outputs,
                                          HostTime at);

/// Of many values, in ns.
struct Spread {
    std::uint64_t count = 0;
    double mean = 0;
    double rms = 0;
    double p99 = 0;  ///< of the amount
    double most = 0;
    double nees = 0;  ///< mean square in sigmas; 0: not known
};

struct ClockEvaluation {
    std::uint64_t lives = 0;
    std::uint64_t exchanges = 0;  ///< of the longest life, which is evaluated
    std::uint64_t one_way = 0;
    double duration_s = 0;
    double settled_s = 0;  ///< what came before does not count
    double skew_ppm = 0;
    Spread innovation;  ///< by which a message moved the estimate
    Spread residual;    ///< middle of an exchange against the estimate
    Spread live;        ///< estimate at the time against that by all messages
    bool labelled = false;
    Spread pps_published;  ///< stamps of PPS pulses against whole seconds
    Spread pps_link;       ///< the same instants by messages alone
    Spread pps_smoothed;   ///< and by all messages
    std::vector<std::string> notes;
};

/// Error: no usable exchange, or less than ten seconds.
Expected<ClockEvaluation> evaluate_clock(const RecordedClocks& clocks);

nlohmann::json to_json(const ClockEvaluation& evaluation);
std::string to_text(const ClockEvaluation& evaluation);

}  // namespace versavis::client
