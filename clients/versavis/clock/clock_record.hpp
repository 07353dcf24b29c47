// SPDX-License-Identifier: BSD-3-Clause
// Writes the stamps by which the clocks are compared to CSV files.
#pragma once

#include <functional>
#include <string>

#include "versavis/time.hpp"

namespace versavis::client {

struct ClockRecordSettings {
    std::string instance;
    Duration duration;      ///< of the recording; 0: until stopped
    std::string exchanges;  ///< file: sent, received, answered, arrived
    std::string one_way;    ///< file: departure, arrival; empty: none
    std::function<bool()> stop;
};

/// Prints what it does and why it ended; returns an exit code. A recording covers one boot of the
/// board and ends when the board restarts. What was recorded until then is in the files, in whole
/// lines.
int record_clock(const ClockRecordSettings& settings);

}  // namespace versavis::client
