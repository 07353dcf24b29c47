// SPDX-License-Identifier: BSD-3-Clause
// The other end of the link: reads at the pace of USB, or stalls, and keeps every message.
#pragma once

#include <map>
#include <span>
#include <vector>

#include "wire/packet.hpp"

namespace versavis::scenario {

struct Inbox {
    std::map<unsigned, std::vector<wire::Exposure>> exposures;  ///< by camera
    std::vector<wire::Event> events;
    std::map<unsigned, std::vector<wire::ImuSample>> samples;  ///< by port
    std::vector<wire::Health> healths;
    std::vector<wire::BoardHello> hellos;
    std::vector<wire::ConfigurationAnswer> answers;
    std::vector<wire::Refusal> refusals;
    std::vector<wire::ClockAnswer> clock_answers;
    std::vector<wire::ClockFollowUp> follow_ups;
    std::vector<wire::Log> logs;
    std::uint64_t packets = 0;
    std::uint64_t lost = 0;  ///< by sequence numbers

    std::vector<wire::Event> events_of(wire::BoardEventKind kind) const;
};

class HostModel {
 public:
    void take(std::span<const std::uint8_t> bytes);
    Inbox inbox;

 private:
    void take(const wire::Packet& packet);

    wire::Decoder decoder_;
    std::uint32_t nonce_ = 0;
    std::uint32_t next_sequence_ = 0;
};

}  // namespace versavis::scenario
