// SPDX-License-Identifier: BSD-3-Clause
// What a camera says of its PTP port, and what its clock shows.
#pragma once

#include <optional>
#include <string>

#include "camera/aravis_node_map.hpp"
#include "pipeline/ptp_clocks.hpp"
#include "versavis/error.hpp"

namespace versavis::daemon {

/// Of the control thread. The camera's features must outlive it.
class PtpReader {
 public:
    /// Errors: the camera does not say what its PTP port does, or its clock cannot be read.
    static Expected<PtpReader> create(AravisNodeMap& nodes, const std::string& camera);

    /// None: the camera does not answer.
    std::optional<PtpStatus> status();
    std::optional<clock::ClockReading> clock();

 private:
    explicit PtpReader(AravisNodeMap& nodes) : nodes_(&nodes) {}

    AravisNodeMap* nodes_;
    std::uint64_t ticks_per_second_ = 0;
    std::string state_;
    std::string latch_data_;  ///< empty: the state needs no command
    std::string servo_;       ///< empty: it does not say
    std::string offset_;
    std::string grandmaster_;
    std::string latch_;
    std::string latched_;
};

}  // namespace versavis::daemon
