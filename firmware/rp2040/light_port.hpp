// SPDX-License-Identifier: BSD-3-Clause
// The light: words that say until when it is dark, lit, or lit while a camera exposes.
#pragma once

#include "board_clock.hpp"
#include "state_machine.hpp"

namespace versavis::rp2040 {

/// The output port calls it from the interrupts that send words, in the order of their times. The
/// main loop configures it.
class LightPort {
 public:
    enum class State : std::uint8_t { asleep, lit, follows };

    explicit LightPort(BoardClock& clock) : clock_(clock) {}

    /// The machine is ready to start.
    void set_up();

    /// Which cameras `follows` means. Whatever is wanted, it is dark once the light was wanted for
    /// as long as `limit`, until it is no longer. The pin is driven from now on.
    void configure(std::uint32_t cameras, bool inverted, Nanoseconds limit);

    /// For all that comes of one word of the sequencer.
    bool has_room() const { return machine_.waiting() <= fifo - 2; }

    /// Time from one word of the sequencer to the next.
    void pass(std::uint32_t cycles) {
        if (state_ != State::asleep) last(static_cast<std::int32_t>(cycles));
    }
    /// With it, in this cycle.
    void change(std::uint32_t cycle, State wanted) {
        if (wanted != wanted_) become(cycle, wanted);
    }
    /// No change is known yet: what holds goes on.
    void go_on() {
        if (behind_ >= shortest_extension) send();
    }

 private:
    static constexpr unsigned fifo = 8;
    /// Less is not worth a word. If higher, the machine may be without one for a moment.
    static constexpr std::int32_t shortest_extension = 10'000 / cycle_ns;

    void load(const light::Following& following);
    void last(std::int32_t cycles);
    void become(std::uint32_t cycle, State wanted);
    void enter(State state);
    void wait_until(std::uint32_t cycle);
    void send();

    BoardClock& clock_;
    StateMachine machine_{0, light::machine};
    State wanted_ = State::asleep;
    State state_ = State::asleep;     ///< wanted_, or cut
    std::int32_t behind_ = 0;         ///< cycles for which the machine has no word yet
    std::int32_t left_ = 0;           ///< cycles until it is cut
    std::int32_t limit_ = 0;          ///< in cycles
    std::uint32_t dark_from_us_ = 0;  ///< when it was commanded to sleep, by the timer
    std::uint32_t round_cycles_ = 1;  ///< of `follows`
    bool has_cameras_ = false;
};

}  // namespace versavis::rp2040
