// SPDX-License-Identifier: BSD-3-Clause
// Sends frames as GigE Vision stream packets, paced like a real link, and sends lost packets again
// on request.
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <deque>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "frame_queue.hpp"
#include "posix/file_descriptor.hpp"

namespace versavis::rig {

struct StreamSettings {
    sockaddr_in destination{};
    std::uint32_t packet_size = 1500;  ///< IP and UDP headers included
    std::int64_t packet_delay_ns = 0;  ///< pause between packets
};

/// Thread-safe.
class GvspTransmitter {
 public:
    GvspTransmitter(const std::string& address, double link_mbps, double packet_loss,
                    std::uint64_t seed);

    void configure(const StreamSettings& settings);

    /// UDP port that the packets come from.
    std::uint16_t source_port() const;

    /// Returns when the last packet has left.
    void transmit(StreamFrame frame);

    /// Resends packets `first` to `last` of a frame that was sent recently.
    void resend(std::uint64_t block_id, std::uint32_t first, std::uint32_t last);

    /// Sends one packet of the full size, so that the host can see what gets through.
    void send_test_packet();

    /// Nothing that was sent before is sent again.
    void forget();

 private:
    StreamSettings current_settings();
    void keep(const StreamFrame& frame);
    void send_packets(const StreamFrame& frame, const StreamSettings& settings, std::uint32_t first,
                      std::uint32_t last, bool lossy);
    static std::vector<std::uint8_t> special_body(const StreamFrame& frame,
                                                  const StreamSettings& settings, std::uint32_t id);

    FileDescriptor socket_;
    double link_mbps_;
    double packet_loss_;
    std::mt19937_64 random_;
    std::mutex mutex_;  ///< guards what follows
    StreamSettings settings_;
    std::deque<StreamFrame> sent_;
};

}  // namespace versavis::rig
