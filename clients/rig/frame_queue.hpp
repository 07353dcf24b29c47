// SPDX-License-Identifier: BSD-3-Clause
// Frames on their way out of an emulated camera: each leaves when it is due.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

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
    std::span<const std::uint8_t> pixels;  ///< must outlive the transport; not if it is painted
    /// Paints the pixels, as many as width x height: called once, when the exposure is over.
    std::function<void(std::span<std::uint8_t>)> paint;
    HostTime exposed;                                    ///< the end of its exposure
    std::shared_ptr<std::vector<std::uint8_t>> painted;  ///< filled by paint_when_exposed()
    std::vector<std::uint8_t> chunks;  ///< what follows the pixels; empty: no chunk data
    double loss = 0;                   ///< share of its packets that never leaves
    std::uint32_t largest_packet = 0;  ///< larger ones get lost; 0: none
    HostTime leader_due;               ///< when the leader leaves
    HostTime due;                      ///< when the first packet after it leaves
    std::function<void(bool sent)> done;
    std::function<void(HostTime at)> sent;  ///< called when its last packet leaves

    /// Bytes of pixels and chunks that are sent.
    std::size_t size() const;
    /// Copies a part of them, as it is sent: the frame's mark is in its first pixels.
    void copy(std::size_t at, std::span<std::uint8_t> out) const;
    /// If there is anything to paint. The leader may have left before.
    void paint_when_exposed();
};

/// Returns at this time, at once if it is over.
void sleep_until(HostTime time);

/// Thread-safe.
class FrameQueue {
 public:
    /// `transmit` sends a frame whose leader is due, and returns when all of it has left. It is
    /// called on the queue's thread.
    explicit FrameQueue(std::function<void(StreamFrame)> transmit);
    ~FrameQueue();
    FrameQueue(const FrameQueue&) = delete;
    FrameQueue& operator=(const FrameQueue&) = delete;

    /// When too many are waiting already it is dropped, as by a camera with a full buffer.
    void send(StreamFrame frame);

    /// Drops what is waiting.
    void clear();

 private:
    void run();

    std::function<void(StreamFrame)> transmit_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<StreamFrame> frames_;
    bool stop_ = false;
    std::thread thread_;
};

}  // namespace versavis::rig
