// SPDX-License-Identifier: BSD-3-Clause
// Topics of ROS 2 on DDS: names, types and quality of service as its nodes expect them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "versavis/error.hpp"
#include "versavis/ring_payload.hpp"

struct ddsi_sertype;

namespace versavis::dds {

/// An entity of Cyclone DDS, with all that belongs to it.
class Entity {
 public:
    explicit Entity(std::int32_t handle = 0) : handle_(handle) {}
    Entity(Entity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
    Entity& operator=(Entity&& other) noexcept {
        std::swap(handle_, other.handle_);
        return *this;
    }
    ~Entity();

    std::int32_t handle() const { return handle_; }

 private:
    std::int32_t handle_;
};

struct NetworkSettings {
    std::uint32_t domain = 0;
    std::vector<std::string> interfaces{};  ///< by name or address; empty: Cyclone's choice
};

/// The configuration of Cyclone DDS for these; $CYCLONEDDS_URI, if it is set, comes after it.
std::string cyclone_configuration(const NetworkSettings& settings);

class Participant {
 public:
    /// Errors: an interface that is not there, or a configuration that Cyclone refuses.
    static Expected<Participant> create(const NetworkSettings& settings);

    std::int32_t handle() const { return participant_.handle(); }

 private:
    Participant(Entity domain, Entity participant)
        : domain_(std::move(domain)), participant_(std::move(participant)) {}

    Entity domain_;
    Entity participant_;
};

/// `sensor_msgs::msg::dds_::Image_` of `sensor_msgs/msg/Image`.
std::string dds_type_name(std::string_view type);

/// What ROS 2 since Iron knows a type by; empty: not one of those that are published.
std::string_view type_hash(std::string_view type);

class Writer {
 public:
    /// `topic` as ROS has it, with a slash in front. Errors: refused by Cyclone DDS.
    static Expected<Writer> create(const Participant& participant, const std::string& topic,
                                   std::string_view type);

    /// Without one, nothing needs to be made.
    bool has_readers() const;

    /// `message`: CDR with its four bytes in front.
    Expected<> write(std::string_view message) const;

    /// The same with a payload of a ring behind it. False: the writer of the ring needed its memory
    /// meanwhile; nothing was sent.
    Expected<bool> write(std::string_view head, const ring::Payload& payload) const;

 private:
    Writer(std::string topic, Entity writer, const ddsi_sertype* type)
        : topic_(std::move(topic)), writer_(std::move(writer)), type_(type) {}
    Expected<> sent(std::int32_t result) const;

    std::string topic_;
    Entity writer_;
    const ddsi_sertype* type_;  ///< of the topic, which lives as long as the participant
};

}  // namespace versavis::dds
