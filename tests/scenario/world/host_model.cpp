// SPDX-License-Identifier: BSD-3-Clause
#include "host_model.hpp"

#include <algorithm>
#include <iterator>

namespace versavis::scenario {

namespace {

template <class T>
bool keep(const wire::Packet& packet, std::vector<T>& list) {
    T message{};
    if (!packet.read(message)) return false;
    list.push_back(message);
    return true;
}

}  // namespace

std::vector<wire::Event> Inbox::events_of(wire::BoardEventKind kind) const {
    std::vector<wire::Event> found;
    std::copy_if(events.begin(), events.end(), std::back_inserter(found),
                 [kind](const wire::Event& event) { return event.kind == kind; });
    return found;
}

void HostModel::take(std::span<const std::uint8_t> bytes) {
    decoder_.feed(bytes.data(), bytes.size(), [this](const wire::Packet& packet) { take(packet); });
}

void HostModel::take(const wire::Packet& packet) {
    ++inbox.packets;
    if (packet.header.nonce == nonce_) inbox.lost += packet.header.sequence - next_sequence_;
    nonce_ = packet.header.nonce;
    next_sequence_ = packet.header.sequence + 1;
    wire::Exposure exposure{};
    wire::ImuSample sample{};
    if (packet.read(exposure)) {
        inbox.exposures[exposure.camera].push_back(exposure);
    } else if (packet.read(sample)) {
        inbox.samples[sample.imu].push_back(sample);
    } else {
        keep(packet, inbox.events) || keep(packet, inbox.healths) || keep(packet, inbox.hellos) ||
            keep(packet, inbox.answers) || keep(packet, inbox.refusals) ||
            keep(packet, inbox.clock_answers) || keep(packet, inbox.follow_ups) ||
            keep(packet, inbox.logs);
    }
}

}  // namespace versavis::scenario
