// SPDX-License-Identifier: BSD-3-Clause
// Publishes the streams of an instance as topics of ROS 2: /cam0/image_raw, .../compressed,
// /cam0/camera_info, /imu0/data_raw, /imu0/mag, /imu0/temperature, /nmea0/nmea_sentence, /utc, and
// /diagnostics once a second. Messages are made only for topics that somebody reads. Used by one
// thread.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "recording/lenses.hpp"
#include "ros_client/stream_group.hpp"
#include "writer.hpp"

namespace versavis::dds {

struct BridgeSettings {
    std::string instance;
    std::string prefix;  ///< of all topics but /diagnostics, as "/car"; may be empty
    client::Lenses lenses{};
};

struct BridgeCounts {
    std::uint64_t sent = 0;
    std::uint64_t overtaken = 0;  ///< frames that the service overwrote before they were sent
    std::uint64_t lost = 0;       ///< items that were overwritten before they were read
};

class Bridge : private ros_client::Sink {
 public:
    Bridge(const Participant& participant, BridgeSettings settings);

    /// Publishes what has come, waiting for it up to `timeout`. Errors: of Cyclone DDS.
    Expected<> turn(Duration timeout);

    BridgeCounts counts() const { return {sent_, overtaken_, streams_.lost()}; }

 private:
    /// Topics are there before the first message, so that nodes find them.
    Expected<> on_stream(const std::string& name, ring::StreamKind kind) override;
    Expected<> on_frame(const std::string& name, const Frame& frame) override;
    Expected<> on_sample(const std::string& name, const ImuSample& sample) override;
    Expected<> on_event(const std::string& name, const Event& event) override;
    bool takes_sentences() const override { return true; }
    Expected<> on_sentence(const std::string& name, const NmeaSentence& sentence) override;

    Expected<> send_jpeg(const std::string& name, const Frame& frame);
    Expected<> publish_diagnostics();
    Expected<> send(const std::string& topic, const char* type, const std::string& message);
    Expected<Writer*> writer(const std::string& topic, const char* type);
    void warn_once(const std::string& text);

    const Participant& participant_;
    BridgeSettings settings_;
    ros_client::StreamGroup streams_;
    std::map<std::string, Writer> writers_;  ///< by topic
    std::set<std::string> warned_;
    std::optional<HostTime> reported_;
    HostTime next_jpeg_{INT64_MIN};
    std::uint64_t sent_ = 0;
    std::uint64_t overtaken_ = 0;
};

}  // namespace versavis::dds
