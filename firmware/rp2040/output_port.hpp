// SPDX-License-Identifier: BSD-3-Clause
// Output words at their times: a queue in memory, of which the sequencer gets what is due soon.
#pragma once

#include "board_clock.hpp"
#include "light_port.hpp"
#include "loop_signal.hpp"
#include "state_machine.hpp"
#include "wake_flag.hpp"

namespace versavis::rp2040 {

/// Queues the core's output words and feeds the sequencer. The main loop pushes; commit() runs in
/// the interrupt of a timer.
class OutputPort final : public firmware::OutputSchedule {
 public:
    static constexpr unsigned grain_bits = 3;
    static_assert(1U << grain_bits == cycle_ns);
    static constexpr Nanoseconds step = sequencer::shortest_cycles * cycle_ns;

    OutputPort(BoardClock& clock, WakeFlag& wake_flag, LightPort& light, LoopSignal& loop)
        : clock_(clock), wake_flag_(wake_flag), light_(light), loop_(loop) {}

    /// The sequencer is ready to start, and its first word with it.
    void set_up();

    /// From the timer's interrupt, and from the one of the block when it was asked for.
    void commit();

    Nanoseconds push(Nanoseconds at, std::uint32_t levels) override;

    /// The first word of all, so that the outputs rest at these levels; returns when it leaves.
    Nanoseconds rest(std::uint32_t signals);

 private:
    struct Levels {
        std::uint16_t pins;  ///< but for the loop
        LightPort::State light;
    };
    struct Word {
        std::uint32_t cycle;  ///< the lower bits of when it leaves
        Levels levels;
    };
    static constexpr unsigned capacity = 64;
    static constexpr unsigned fifo = 8;

    static Levels levels_of(std::uint32_t signals);
    Nanoseconds add(Nanoseconds at, Levels levels);
    void send_next(std::uint32_t until);
    void send(std::uint32_t cycle, Levels levels);
    void send_through_loop(std::uint32_t cycle);
    const Word& front() const { return words_[first_]; }

    BoardClock& clock_;
    WakeFlag& wake_flag_;
    LightPort& light_;
    LoopSignal& loop_;
    StateMachine machine_{0, sequencer::machine};
    unsigned first_ = 0;
    volatile unsigned size_ = 0;
    volatile bool wants_room_ = false;
    unsigned count_ = 0;  ///< of words ever pushed
    unsigned commits_ = 0;
    Levels levels_ = {};             ///< of the last word sent
    unsigned loop_due_ = 0;          ///< commits until the next edge through the loop
    std::uint32_t sent_ = 0;         ///< in which cycle the last word leaves that was sent
    Nanoseconds last_ = 0;           ///< and the last one of all
    Nanoseconds recent_[fifo] = {};  ///< when the newest words leave
    Word words_[capacity] = {};
};

}  // namespace versavis::rp2040
