// SPDX-License-Identifier: BSD-3-Clause
// The health of each device over time: what it delivered lately, what is wrong, and since when.
#pragma once

#include <deque>
#include <map>
#include <string>
#include <utility>

#include "delivery.hpp"
#include "status.hpp"

namespace versavis::daemon {

/// Not thread-safe.
class HealthWatch {
 public:
    /// Fills in deliveries, what is recent, and the diagnoses. Call it about twice a second.
    void examine(Status& status);

 private:
    template <class Report>
    struct Device {
        explicit Device(double configured_hz) : rate_hz(configured_hz), delivery(configured_hz) {}

        double rate_hz;
        Delivery delivery;
        std::uint64_t starts = 0;
        std::deque<std::pair<HostTime, Report>> reports;  ///< oldest first
    };

    void measure(CameraStatus& camera, const Status& status);
    void measure(ImuStatus& imu, const Status& status);
    void date(const std::string& device, const std::string& state, Diagnosis& diagnosis,
              HostTime now);

    std::map<std::string, Device<PipelineReport>> cameras_;
    std::map<std::string, Device<ImuReport>> imus_;
    std::map<std::string, std::pair<std::string, Diagnosis>> lasting_;  ///< states, by device
    std::map<std::string, HostTime> explained_;  ///< cameras whose faults had a cause
};

}  // namespace versavis::daemon
