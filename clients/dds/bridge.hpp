// SPDX-License-Identifier: BSD-3-Clause
// Publishes the streams of an instance as topics of ROS 2: /cam0/image_raw, /cam0/camera_info,
// /imu0/data_raw, /imu0/mag, /imu0/temperature, /utc, and /diagnostics once a second. Messages are
// made only for topics that somebody reads. Used by one thread.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "ros_client/stream_group.hpp"
#include "writer.hpp"

namespace versavis::dds {

struct BridgeCounts {
    std::uint64_t sent = 0;
    std::uint64_t overtaken = 0;  ///< frames that the service overwrote before they were sent
    std::uint64_t lost = 0;       ///< items that were overwritten before they were read
};

class Bridge : private ros_client::Sink {
 public:
    /// `prefix` of all topics but /diagnostics, as "/car"; may be empty.
    Bridge(const Participant& participant, const std::string& instance, std::string prefix);

    /// Publishes what has come, waiting for it up to `timeout`. Errors: of Cyclone DDS.
    Expected<> turn(Duration timeout);

    BridgeCounts counts() const { return {sent_, overtaken_, streams_.lost()}; }

 private:
    /// Topics are there before the first message, so that nodes find them.
    Expected<> on_stream(const std::string& name, ring::StreamKind kind) override;
    Expected<> on_frame(const std::string& name, const Frame& frame) override;
    Expected<> on_sample(const std::string& name, const ImuSample& sample) override;
    Expected<> on_event(const std::string& name, const Event& event) override;

    Expected<> publish_diagnostics();
    Expected<> send(const std::string& topic, const char* type, const std::string& message);
    Expected<Writer*> writer(const std::string& topic, const char* type);

    const Participant& participant_;
    std::string instance_;
    std::string prefix_;
    ros_client::StreamGroup streams_;
    std::map<std::string, Writer> writers_;  ///< by topic
    std::optional<HostTime> reported_;
    std::uint64_t sent_ = 0;
    std::uint64_t overtaken_ = 0;
};

}  // namespace versavis::dds
