// SPDX-License-Identifier: BSD-3-Clause
// What messages take from host to board and back: buses, schedulers and traces of real ones.
#pragma once

#include <memory>
#include <random>
#include <string>

#include "crystal.hpp"

namespace versavis::clock_world {

using Random = std::mt19937_64;

struct Span {
    TrueTime begin;
    TrueTime end;
    bool holds(TrueTime at) const { return begin <= at && at < end; }
};

class Link {
 public:
    virtual ~Link() = default;
    virtual Duration to_board(TrueTime sent, Random& random) = 0;
    virtual Duration to_host(TrueTime sent, Random& random) = 0;
};

/// 0.3 to 10.3 ms, all equally likely, each way on its own: the round trip shows the error.
std::unique_ptr<Link> visible_jitter();

/// The same to the board, and back whatever makes the round trip 10.6 ms: it shows nothing.
std::unique_ptr<Link> invisible_jitter();

struct UsbSettings {
    Span load{};  ///< the scheduler delays each wake-up by 6 ms more in the mean
    Duration longer_to_host{};
    Span slow{};        ///< each direction takes longer
    Duration slower{};  ///< by so much
    Duration transfer = microseconds(12);
    Duration wake_up = microseconds(15);  ///< of the host, in the median
    bool wakes_up_to_send = true;         ///< a third of a wake-up is between stamp and bus
};

/// USB full speed: to the board in the next frame of 1 ms, to the host at the next poll, every 125
/// us; wake-ups of the host are log-normal, a few are late by 0.15 ms, some by 2 ms.
std::unique_ptr<Link> usb_full_speed(const UsbSettings& settings, Random& random);

/// Delays in the order in which they were measured, from a random one on. File:
/// to_board_ns,to_host_ns.
std::unique_ptr<Link> measured(const std::string& file, Random& random);

}  // namespace versavis::clock_world
