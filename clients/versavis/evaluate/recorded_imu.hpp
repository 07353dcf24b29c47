// SPDX-License-Identifier: BSD-3-Clause
// The samples of an IMU in a recording, of the span in which their stamps are continuous.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "evaluate/allan.hpp"
#include "recording/recording.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// Asked now and then; false: stop.
using GoOn = std::function<bool()>;

struct RecordedImu {
    RestingImu samples;
    std::uint64_t life = 0;  ///< of the service, and its epoch: those with most samples
    std::uint32_t epoch = 0;
    Duration filter_delay;        ///< already subtracted from the times
    std::uint64_t elsewhere = 0;  ///< samples of other epochs
    std::uint64_t faulty = 0;     ///< the sensor itself reported an error
    std::uint64_t repeated = 0;   ///< with the data of the one before
};

/// The only stream of a kind, or that of this name. Errors: no such stream; none, or several.
Expected<std::string> find_stream(const Recording& recording, ring::StreamKind kind,
                                  const std::string& name);

/// Samples that repeat the one before: an even series needs them, but they measure nothing new.
enum class Repeated { kept, left_out };

/// `from_s` and `to_s`: since the first sample; to 0: all. Errors: no sample in there, the file is
/// damaged, stopped.
Expected<RecordedImu> read_imu(const Recording& recording, const std::string& name, double from_s,
                               double to_s, Repeated repeated, const GoOn& go_on);

}  // namespace versavis::client
