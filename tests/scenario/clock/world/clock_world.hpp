// SPDX-License-Identifier: BSD-3-Clause
// A board, a host and their messages in simulated time, with the truth of both clocks.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "crystal.hpp"
#include "engine/clock/messages.hpp"
#include "link.hpp"

namespace versavis::clock_world {

using MakeLink = std::function<std::unique_ptr<Link>(Random&)>;

/// From `at` on a clock shows `by` more; from then on it also gains `rate_ppm`.
struct ClockChange {
    TrueTime at;
    Duration by;
    double rate_ppm = 0;
};

struct Settings {
    std::uint64_t seed = 1;
    Duration length = seconds(900);
    double exchange_hz = 10;
    double dither = 0.25;  ///< of the interval, early or late
    double imu_hz = 0;
    MakeLink link = [](Random& random) { return usb_full_speed({}, random); };
    CrystalSettings crystal;
    Duration board_begin = seconds(1);  ///< its time at the beginning
    double lost = 0;                    ///< share of the messages
    Span silence{};                     ///< no message passes
    std::optional<TrueTime> board_reset;
    std::vector<ClockChange> host_changes;  ///< in order
};

struct Delivery {
    TrueTime at;
    clock::Message message;
};

class World {
 public:
    explicit World(const Settings& settings);

    /// In the order in which they reach the host's program.
    const std::vector<Delivery>& deliveries() const { return deliveries_; }
    BoardTime board(TrueTime at) const;
    HostTime host(TrueTime at) const;
    const Settings& settings() const { return settings_; }

 private:
    void exchange_all();
    void send_imu_packets();
    bool lost(TrueTime at);

    Settings settings_;
    Random random_;
    Crystal crystal_;
    std::unique_ptr<Link> link_;
    std::vector<Delivery> deliveries_;
};

}  // namespace versavis::clock_world
