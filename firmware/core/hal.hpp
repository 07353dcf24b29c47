// SPDX-License-Identifier: BSD-3-Clause
// What the portable core needs of a board: time, scheduled outputs, stamped edges, an IMU bus and a byte
// link.
#pragma once

#include <cstddef>
#include <cstdint>

namespace versavis::firmware {

/// Board time: since boot, 64 bits, never backwards.
using Nanoseconds = std::int64_t;

inline constexpr std::size_t camera_count = 4;

struct Clock64 {
    virtual Nanoseconds now() = 0;

 protected:
    ~Clock64() = default;
};

/// Output pins, driven by hardware from a queue of {time, levels}. Bit n is the trigger of camera n.
struct OutputSchedule {
    /// False when the queue is full. Times must not decrease.
    virtual bool push(Nanoseconds at, std::uint32_t levels) = 0;
    /// Nanoseconds by which a word left too late since the last call; 0: none did.
    virtual Nanoseconds take_lateness() = 0;

 protected:
    ~OutputSchedule() = default;
};

struct Edge {
    Nanoseconds at;
    std::uint8_t input;  ///< camera number
    bool level;
};

/// Edges of the exposure lines, stamped by hardware, in order.
struct EdgeStream {
    virtual bool pop(Edge& edge) = 0;
    /// Edges lost since the last call because nobody popped them.
    virtual std::uint32_t take_lost() = 0;

 protected:
    ~EdgeStream() = default;
};

inline constexpr std::size_t max_burst = 32;

struct Transfer {
    Nanoseconds started;  ///< true start of the burst
    std::size_t size;
    std::uint8_t received[max_burst];
};

/// SPI bus of the IMU: a burst starts at a time set in hardware, and completes later.
struct ImuBus {
    /// False while a burst is set or under way.
    virtual bool start(Nanoseconds at, const std::uint8_t* transmit, std::size_t size) = 0;
    virtual bool complete(Transfer& transfer) = 0;

 protected:
    ~ImuBus() = default;
};

/// Bytes to and from the host. Never blocks.
struct ByteLink {
    virtual std::size_t free_space() = 0;
    virtual void write(const std::uint8_t* data, std::size_t size) = 0;
    /// `received` is when the newest of the bytes entered the board.
    virtual std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) = 0;

 protected:
    ~ByteLink() = default;
};

struct Rebooter {
    virtual void reboot(bool to_boot_loader) = 0;

 protected:
    ~Rebooter() = default;
};

struct Hal {
    Clock64& clock;
    OutputSchedule& outputs;
    EdgeStream& edges;
    ImuBus& imu_bus;
    ByteLink& link;
    Rebooter& rebooter;
};

}  // namespace versavis::firmware
