// SPDX-License-Identifier: BSD-3-Clause
// One camera, its board and pairing, fed by hand, piece by piece.
#pragma once

#include <catch2/catch.hpp>
#include <cstdint>
#include <ostream>
#include <utility>
#include <vector>

#include "engine/pairing/pairing.hpp"

namespace versavis::test {

using namespace versavis::pairing;

/// All that pairing decided, in order.
class Decisions final : public Outcome {
 public:
    struct Frame {
        std::uint64_t id;
        EventReason reason;
        std::uint64_t guess;  ///< trigger; 0: none
    };
    struct Pulse {
        std::uint64_t trigger;
        EventReason reason;
    };

    void paired(const Arrival& arrival, const Exposure& exposure) override {
        pairs.emplace_back(arrival.block_id, exposure.trigger);
    }
    void frame_unpaired(const Arrival& arrival, EventReason reason,
                        const Exposure* guess) override {
        frames.push_back({arrival.block_id, reason, guess == nullptr ? 0 : guess->trigger});
    }
    void exposure_unpaired(const Exposure& exposure, EventReason reason) override {
        pulses.push_back({exposure.trigger, reason});
    }
    void locked(const Exposure& first) override { locks.push_back(first.trigger); }
    void slipped(const Arrival& at) override { slips.push_back(at.block_id); }

    std::vector<std::pair<std::uint64_t, std::uint64_t>> pairs;  ///< ids and triggers
    std::vector<Frame> frames;
    std::vector<Pulse> pulses;
    std::vector<std::uint64_t> locks;
    std::vector<std::uint64_t> slips;
};

inline bool operator==(const Decisions::Pulse& a, const Decisions::Pulse& b) {
    return a.trigger == b.trigger && a.reason == b.reason;
}
inline std::ostream& operator<<(std::ostream& out, const Decisions::Pulse& pulse) {
    return out << pulse.trigger << ": " << to_string(pulse.reason);
}

inline constexpr Duration period = milliseconds(50);
inline constexpr Duration exposed_for = milliseconds(5);
inline constexpr Duration record_after = milliseconds(2);  ///< the end of the exposure
inline constexpr Duration host_ahead = seconds(1000);      ///< of the board
/// Grid points of a start: no other alignment of them has the same gaps.
inline constexpr std::uint64_t pattern[] = {1, 2, 4, 5, 8, 9, 11, 12, 15, 17, 18, 20};

/// One camera that takes each trigger, its board, and pairing.
struct Bench {
    explicit Bench(const Limits& limits = made()) : pairing(limits, decided) {}

    static Limits made() {
        Limits limits;
        limits.period = period;
        limits.stamped = Instant::start;
        return limits;
    }

    static Exposure exposure(std::uint64_t trigger, std::uint64_t tick) {
        Exposure made;
        made.trigger = trigger;
        made.tick = tick;
        made.start = BoardTime{} + seconds(5) + period * static_cast<std::int64_t>(tick);
        made.end = made.start + exposed_for;
        made.end_on_host = made.earliest_on_host = HostTime{made.end.ns} + host_ahead;
        made.recorded = made.end_on_host + record_after;
        return made;
    }

    Arrival frame(std::uint64_t id, const Exposure& of) const {
        Arrival made;
        made.block_id = id;
        made.camera_time = CameraTime{of.start.ns} + camera_ahead;
        made.arrived = of.end_on_host + frame_after;
        return made;
    }

    Exposure next(std::uint64_t steps = 1) { return exposure(next_trigger++, tick += steps); }

    /// A trigger, its record and its frame.
    void take(std::uint64_t steps = 1) {
        const Exposure one = next(steps);
        pairing.add(one);
        pairing.add(frame(next_id++, one));
        now = one.end_on_host + frame_after;
    }

    void lock() {
        const std::uint64_t base = tick;
        for (const std::uint64_t at : pattern) take(base + at - tick);
        REQUIRE(pairing.state() == State::locked);
        for (int i = 0; i < 10; ++i) take();
    }

    /// Three frames a second apart, and ten at the working rate.
    void lock_slowly() {
        pairing.start_requested(Start::slow, now);
        for (int i = 0; i < 3; ++i) take(20);
        REQUIRE(pairing.state() == State::locked);
        pairing.start_requested(Start::steady, now);
        for (int i = 0; i < 10; ++i) take();
        REQUIRE(decided.slips.empty());
        decided = {};
    }

    Duration frame_after = milliseconds(20);  ///< the end of the exposure
    Duration camera_ahead = seconds(7);       ///< of the board
    Decisions decided;
    Pairing pairing;
    std::uint64_t next_trigger = 1;
    std::uint64_t next_id = 1;
    std::uint64_t tick = 0;
    HostTime now;
};

}  // namespace versavis::test
