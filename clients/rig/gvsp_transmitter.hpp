// SPDX-License-Identifier: BSD-3-Clause
// Sends frames as GigE Vision stream packets, paced like a real link, and sends lost packets again
// on request.
#pragma once

#include <netinet/in.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <span>
#include <thread>
#include <vector>

#include "posix/file_descriptor.hpp"
#include "versavis/time.hpp"

namespace versavis::rig {

/// What part of a frame is never sent.
enum class Missing { nothing, leader, end, second_half };

struct StreamFrame {
    std::uint64_t block_id = 0;
    bool extended_id = false;  ///< 64 bits, else 16
    Missing missing = Missing::nothing;
    bool after_next = false;  ///< it is sent after the frame that follows it
    std::uint64_t camera_time_ns = 0;
    std::uint64_t serial = 0;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::span<const std::uint8_t> pixels;  ///< must outlive the transmitter; not if it is painted
    /// Paints the pixels, as many as width x height: called once, when the exposure is over.
    std::function<void(std::span<std::uint8_t>)> paint;
    HostTime exposed;                                    ///< the end of its exposure
    std::shared_ptr<std::vector<std::uint8_t>> painted;  ///< filled by the transmitter
    std::vector<std::uint8_t> chunks;  ///< what follows the pixels; empty: no chunk data
    double loss = 0;                   ///< share of its packets that never leaves
    std::uint32_t largest_packet = 0;  ///< larger ones get lost; 0: none
    HostTime leader_due;               ///< when the leader leaves
    HostTime due;                      ///< when the first packet after it leaves
    std::function<void(bool sent)> done;
    std::function<void(HostTime at)> sent;  ///< called when its last packet leaves
};

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
    ~GvspTransmitter();

    void configure(const StreamSettings& settings);

    /// UDP port that the packets come from.
    std::uint16_t source_port() const;

    /// Queues a frame. When too many are waiting already it is dropped, as by a camera with a full
    /// buffer.
    void send(StreamFrame frame);

    /// Resends packets `first` to `last` of a frame that was sent recently.
    void resend(std::uint64_t block_id, std::uint32_t first, std::uint32_t last);

    /// Sends one packet of the full size, so that the host can see what gets through.
    void send_test_packet();

    /// Drops what is waiting.
    void clear();

    /// Holds everything back until `until`.
    void mute(HostTime until);

 private:
    void run();
    void transmit(StreamFrame frame, const StreamSettings& settings);
    void keep(const StreamFrame& frame);
    void send_packets(const StreamFrame& frame, const StreamSettings& settings, std::uint32_t first,
                      std::uint32_t last, bool lossy);
    static std::vector<std::uint8_t> special_body(const StreamFrame& frame,
                                                  const StreamSettings& settings, std::uint32_t id);
    bool muted() const;

    FileDescriptor socket_;
    double link_mbps_;
    double packet_loss_;
    std::mt19937_64 random_;
    mutable std::mutex mutex_;
    std::condition_variable wake_;
    StreamSettings settings_;
    std::deque<StreamFrame> queue_;
    std::deque<StreamFrame> sent_;
    HostTime muted_until_;
    bool stop_ = false;
    std::thread thread_;
};

}  // namespace versavis::rig
