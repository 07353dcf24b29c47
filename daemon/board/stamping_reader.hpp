// SPDX-License-Identifier: BSD-3-Clause
// Reads a byte stream on a thread of its own, which stamps what comes and does nothing else.
#pragma once

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstdint>
#include <optional>
#include <span>
#include <thread>

#include "base/wake_up.hpp"
#include "board/byte_stream.hpp"

namespace versavis::daemon {

/// Between the reading thread and the one that drains nothing is locked and nothing allocated.
class StampingReader {
 public:
    /// Reads until it is destroyed, or the stream ends. Each time that something came, or the
    /// stream ended, `consumer` is signalled. Stream and consumer must outlive this.
    StampingReader(ByteStream& stream, const WakeUp& consumer);
    ~StampingReader();
    StampingReader(const StampingReader&) = delete;
    StampingReader& operator=(const StampingReader&) = delete;

    /// Calls take(bytes, received) for all that came since the last call, in order. Error: the
    /// stream has ended, and all that came before was taken.
    template <class Take>
    Expected<> drain(Take&& take) {
        const bool ended = ended_.load(std::memory_order_acquire);  // before the last look
        pieces_.consume_all([&](const Piece& piece) {
            take(std::span(piece.bytes.data(), piece.size), piece.received);
        });
        if (ended) return Unexpected(*error_);
        return {};
    }

    /// Bytes that found no room, because nobody drained.
    std::uint64_t dropped() const { return dropped_; }

    /// What the queue holds at least.
    static constexpr std::size_t capacity = 8192;

    /// Bytes of one piece: with its stamp and size 256, so that pieces do not share cache lines.
    static constexpr std::size_t piece_size = 244;

 private:
    struct Piece {
        HostTime received;
        std::uint32_t size = 0;
        std::array<std::uint8_t, piece_size> bytes{};
    };

    void run();
    void keep(std::span<const std::uint8_t> bytes, HostTime received);

    ByteStream& stream_;
    const WakeUp& consumer_;
    boost::lockfree::spsc_queue<Piece> pieces_{capacity};
    std::optional<Error> error_;      ///< of the reading thread until ended_
    std::atomic<bool> ended_{false};  ///< released after the last piece and error_
    std::atomic<bool> stop_{false};
    std::atomic<std::uint64_t> dropped_{0};
    std::thread thread_;
};

}  // namespace versavis::daemon
