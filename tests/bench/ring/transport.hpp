// SPDX-License-Identifier: BSD-3-Clause
// Ways from one writer to readers in other processes, as the benchmark of rings sees them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "versavis/ring_layout.hpp"

namespace versavis::bench {

/// Items of this size are IMU samples, larger ones frames.
inline constexpr std::size_t imu_size = ring::metadata_size;
inline constexpr std::size_t frame_size = 1920 * 1200;

/// As many frames lie in memory as in a ring of the service by default, where there is a choice.
inline constexpr std::uint32_t frame_slots = 17;

struct Channel {
    std::filesystem::path directory;  ///< in shared memory, the channel's own
    std::size_t size = imu_size;      ///< bytes of an item
    bool polling = false;
};

class Sender {
 public:
    virtual ~Sender() = default;
    virtual std::byte* loan() = 0;  ///< where the next item is to be written
    virtual void publish() = 0;
};

class Receiver {
 public:
    virtual ~Receiver() = default;

    /// The next item, there until the next call. nullptr: none yet; unless the channel is for
    /// polling, that is noticed some 20 ms late.
    virtual const std::byte* receive() = 0;

    /// True when what was read of the item is good.
    virtual bool valid() { return true; }
};

struct Transport {
    std::string name;
    std::unique_ptr<Sender> (*sender)(const Channel& channel);

    /// Called once the sender is there; `reader` counts from 0.
    std::unique_ptr<Receiver> (*receiver)(const Channel& channel, unsigned reader);
    unsigned most_readers = 1000;
};

Transport versavis_ring();

/// Of frames, as with `history = "none"`.
inline constexpr auto without_history = "ring without history";
Transport ring_without_history();

/// As with `[memory] sealed`.
inline constexpr auto sealed = "sealed ring";
Transport sealed_ring();

/// The same, but readers from number 1 on are a thousand threads that wait in a loop.
Transport crowded_ring();

/// Items lie in shared memory; one word counts them, and readers wait on it as a futex.
Transport bare_futex();

/// A 64-bit word in shared memory, the stamp. Polling only.
Transport shared_word();

Transport boost_queue();

/// None: the package was not there when this was built.
std::optional<Transport> zeromq();
std::optional<Transport> iceoryx();

/// Starts the daemon of iceoryx, for as long as the result lives. nullptr: it does not start.
std::shared_ptr<void> start_roudi();

}  // namespace versavis::bench
