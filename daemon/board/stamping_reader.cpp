// SPDX-License-Identifier: BSD-3-Clause
#include "board/stamping_reader.hpp"

#include <pthread.h>

#include <algorithm>
#include <cstring>

#include "base/log.hpp"
#include "posix/thread.hpp"

namespace versavis::daemon {

namespace {

/// Above every ordinary thread, below the kernel's own interrupt threads (50).
constexpr int realtime_priority = 20;

/// Longest wait for bytes, and so for the end of the thread.
constexpr Duration longest_read = milliseconds(100);

/// Times that the thread may be woken for nothing, beyond those for something: then it gives
/// real-time priority back.
constexpr int most_idle_wakes = 100;

void ask_for_realtime() {
    const sched_param wanted{realtime_priority};
    const int error = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &wanted);
    if (error != 0)
        log(LogLevel::debug, "board",
            "its bytes are timestamped without real-time priority: {}; set LimitRTPRIO={}",
            std::strerror(error), realtime_priority);
}

void give_realtime_back() {
    const sched_param ordinary{};
    ::pthread_setschedparam(::pthread_self(), SCHED_OTHER, &ordinary);
    log(LogLevel::debug, "board",
        "its link keeps the CPU busy: its bytes are timestamped without real-time priority");
}

}  // namespace

StampingReader::StampingReader(ByteStream& stream, const WakeUp& consumer)
    : stream_(stream), consumer_(consumer) {
    // Touched now, no page of it is missing later.
    while (pieces_.push(Piece{})) {
    }
    pieces_.reset();
    thread_ = start_thread("stamping", [this] { run(); });
}

StampingReader::~StampingReader() {
    stop_ = true;
    thread_.join();
}

void StampingReader::run() {
    ask_for_realtime();
    int idle_wakes = 0;
    std::array<std::uint8_t, largest_chunk> buffer{};
    while (!stop_) {
        const HostTime begin = host_now();
        const auto chunk = stream_.read(buffer, longest_read);
        if (!chunk) {
            error_ = chunk.error();
            break;
        }
        if (chunk->size == 0 && host_now() - begin < longest_read &&
            ++idle_wakes == most_idle_wakes)
            give_realtime_back();
        if (chunk->size == 0) continue;
        if (idle_wakes > 0 && idle_wakes < most_idle_wakes) --idle_wakes;
        keep(std::span(buffer).first(chunk->size), chunk->received);
        consumer_.signal();
    }
    if (!error_) error_ = Error{"board", "its link was closed", ""};
    ended_.store(true, std::memory_order_release);
    consumer_.signal();
}

void StampingReader::keep(std::span<const std::uint8_t> bytes, HostTime received) {
    while (!bytes.empty()) {
        Piece piece;
        piece.received = received;
        piece.size = static_cast<std::uint32_t>(std::min(bytes.size(), piece_size));
        std::copy_n(bytes.begin(), piece.size, piece.bytes.begin());
        if (!pieces_.push(piece)) dropped_ += piece.size;
        bytes = bytes.subspan(piece.size);
    }
}

}  // namespace versavis::daemon
