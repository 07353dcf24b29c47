// SPDX-License-Identifier: BSD-3-Clause
// Publishes the streams of an instance as topics of ROS 2: /cam0/image_raw, /cam0/camera_info,
// /imu0/data_raw, /imu0/mag, /imu0/temperature, /utc, and /diagnostics once a second. Messages are
// made only for topics that somebody reads. Used by one thread.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "versavis/stream.hpp"
#include "versavis/wait_set.hpp"
#include "writer.hpp"

namespace versavis::dds {

struct BridgeCounts {
    std::uint64_t sent = 0;
    std::uint64_t overtaken = 0;  ///< frames that the service overwrote before they were sent
    std::uint64_t lost = 0;       ///< items that were overwritten before they were read
};

class Bridge {
 public:
    /// `prefix` of all topics but /diagnostics, as "/car"; may be empty.
    Bridge(const Participant& participant, std::string instance, std::string prefix);
    ~Bridge();

    /// Publishes what has come, waiting for it up to `timeout`. Errors: of Cyclone DDS.
    Expected<> turn(Duration timeout);

    const BridgeCounts& counts() const { return counts_; }

 private:
    struct Source;

    Expected<> look_for_streams();
    Expected<> announce(Source& source);
    Expected<> publish(Source& source);
    Expected<> publish_frame(Source& source, const Frame& frame);
    Expected<> publish_sample(Source& source, const ImuSample& sample);
    Expected<> publish_event(Source& source, const Event& event);
    Expected<> publish_diagnostics();
    Expected<> send(Source& source, const std::string& topic, const char* type,
                    const std::string& message);
    Expected<Writer*> writer(Source& source, const std::string& topic, const char* type);

    const Participant& participant_;
    std::string instance_;
    std::string prefix_;
    std::map<std::string, std::unique_ptr<Source>> sources_;
    std::vector<Source*> waiting_;  ///< in the order of the wait set
    std::optional<WaitSet> wait_set_;
    std::optional<Writer> diagnostics_;
    BridgeCounts counts_;
    HostTime searched_{INT64_MIN};
    HostTime reported_{INT64_MIN};
};

}  // namespace versavis::dds
