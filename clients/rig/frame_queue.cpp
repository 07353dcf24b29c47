// SPDX-License-Identifier: BSD-3-Clause
#include "frame_queue.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

#include "posix/thread.hpp"
#include "scene.hpp"

namespace versavis::rig {

namespace {

constexpr std::size_t most_waiting = 8;

std::chrono::nanoseconds until(HostTime time) {
    return std::chrono::nanoseconds((time - host_now()).ns);
}

}  // namespace

std::size_t StreamFrame::size() const {
    const std::size_t all = pixels.size() + chunks.size();
    return missing == Missing::second_half ? all / 2 : all;
}

void StreamFrame::copy(std::size_t at, std::span<std::uint8_t> out) const {
    const std::size_t begin = std::min(at, pixels.size());
    const auto seen = pixels.subspan(begin, std::min(out.size(), pixels.size() - begin));
    const auto rest = std::span(chunks).subspan(at - begin, out.size() - seen.size());
    std::copy(rest.begin(), rest.end(), std::copy(seen.begin(), seen.end(), out.begin()));
    const FrameMark mark{FrameMark::expected_magic, serial};
    if (at == 0) std::memcpy(out.data(), &mark, std::min(sizeof mark, out.size()));
}

void StreamFrame::paint_when_exposed() {
    if (!paint) return;
    sleep_until(exposed);
    paint(*painted);
}

void sleep_until(HostTime time) {
    if (const auto left = until(time); left.count() > 0) std::this_thread::sleep_for(left);
}

FrameQueue::FrameQueue(std::function<void(StreamFrame)> transmit)
    : transmit_(std::move(transmit)), thread_(start_thread("transmitter", [this] { run(); })) {}

FrameQueue::~FrameQueue() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_all();
    thread_.join();
}

void FrameQueue::send(StreamFrame frame) {
    {
        const std::lock_guard lock(mutex_);
        if (frames_.size() < most_waiting) {
            const bool overtakes = !frames_.empty() && frames_.back().after_next;
            if (overtakes) {
                frames_.back().after_next = false;
                frames_.back().due = std::max(frames_.back().due, frame.due);
                frames_.back().leader_due = frames_.back().due;
            }
            frames_.insert(overtakes ? frames_.end() - 1 : frames_.end(), std::move(frame));
            wake_.notify_all();
            return;
        }
    }
    frame.done(false);
}

void FrameQueue::clear() {
    std::deque<StreamFrame> dropped;
    {
        const std::lock_guard lock(mutex_);
        dropped.swap(frames_);
    }
    for (const StreamFrame& frame : dropped) frame.done(false);
}

void FrameQueue::run() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
        if (frames_.empty() || frames_.front().after_next) {
            wake_.wait(lock);
            continue;
        }
        if (const auto left = until(frames_.front().leader_due); left.count() > 0) {
            wake_.wait_for(lock, left);
            continue;
        }
        StreamFrame frame = std::move(frames_.front());
        frames_.pop_front();
        lock.unlock();
        if (frame.paint) {
            frame.painted = std::make_shared<std::vector<std::uint8_t>>(std::size_t{frame.width} *
                                                                        frame.height);
            frame.pixels = *frame.painted;
        }
        transmit_(std::move(frame));
        lock.lock();
    }
}

}  // namespace versavis::rig
