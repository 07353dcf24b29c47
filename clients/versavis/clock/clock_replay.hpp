// SPDX-License-Identifier: BSD-3-Clause
// Translates board times again from recorded stamps, as it would have been done live.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/clock/ekf.hpp"
#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/messages.hpp"
#include "engine/clock/smoother.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

enum class EstimatorKind {
    envelope,
    ekf,       ///< the published filter from its published start values
    ekf_fair,  ///< the same, but started from the first exchange
};

/// An estimator chosen at run time.
class ClockEstimator {
 public:
    virtual ~ClockEstimator() = default;
    virtual void add(const clock::Message& message) = 0;
    virtual clock::HostEstimate translate(BoardTime board) const = 0;
    virtual double skew_ppm() const = 0;
    virtual double skew_sigma_ppm() const = 0;
};
std::unique_ptr<ClockEstimator> make_estimator(EstimatorKind kind);

/// A message, and when it became known: earlier answers must not use it.
struct TimedMessage {
    HostTime available;
    clock::Message message;
};

struct ClockQuery {
    HostTime available;
    BoardTime board;
};

using ClockAnswers = std::vector<clock::HostEstimate>;  ///< state init: time and sigma are unknown

/// What was recorded, in order of availability. At the same instant exchanges come first, because
/// they bound the offset from both sides; the rest keep the order of the files.
struct ClockRecording {
    std::vector<TimedMessage> messages;
    std::uint64_t ignored = 0;  ///< rows with stamps beyond 73 years, which no clock shows
};

/// `oneway` may be empty. Error: a file cannot be read; no exchange in it.
Expected<ClockRecording> read_clock_recording(const std::string& exchanges,
                                              const std::string& oneway);

/// One answer per query, in the order of the queries; each uses the messages available by then.
ClockAnswers replayed_answers(const std::vector<TimedMessage>& messages,
                              const std::vector<ClockQuery>& queries, ClockEstimator& estimator);

/// One answer per query, from all messages including later ones.
ClockAnswers smoothed_answers(const std::vector<TimedMessage>& messages,
                              const std::vector<ClockQuery>& queries);

struct ClockReplaySettings {
    std::string exchanges;
    std::string oneway;
    std::string queries;
    std::string out;
    EstimatorKind estimator = EstimatorKind::envelope;
    bool smoothed = false;
};

struct ClockReplaySummary {
    std::size_t messages = 0;
    std::uint64_t ignored = 0;
    std::size_t answers = 0;
    std::size_t unanswered = 0;  ///< queries from before the first message
};

/// Reads the files, answers and writes the answers. `out` appears complete or not at all.
Expected<ClockReplaySummary> replay_clock(const ClockReplaySettings& settings);

/// Error: `out` is one of the inputs. A slip of the hand must not destroy a recording.
Expected<void> check_output(const std::string& out, const std::vector<std::string>& inputs);

}  // namespace versavis::client
