// SPDX-License-Identifier: BSD-3-Clause
#include "output_port.hpp"

#include "clocks.hpp"
#include "start.hpp"

namespace versavis::rp2040 {

namespace {

/// How often words are sent. If lower, it takes more processor time; if higher, the sequencer runs
/// dry, as it does after an interrupt that is held up for 50 us.
constexpr std::uint32_t commit_interval_us = 330;

/// How far ahead they are sent: a word leaves no sooner after it was pushed. If lower, the
/// sequencer runs dry; if higher, the core comes too late.
constexpr Nanoseconds ahead = 380'000;

/// Within that time after a word has left, its room in the sequencer's FIFO is taken again. If
/// lower, a delayed interrupt makes words late unnoticed; if higher, more of eight words that are
/// close together are moved.
constexpr Nanoseconds refill = 5'000;

constexpr std::uint32_t ahead_cycles = ahead / cycle_ns;
constexpr std::int32_t step_cycles = sequencer::shortest_cycles;

Nanoseconds later(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }

std::int32_t from(std::uint32_t cycle, std::uint32_t to) {
    return static_cast<std::int32_t>(to - cycle);
}

/// After this many commits, 21 ms, the main loop runs in any case. If lower, it takes more
/// processor time; if higher, edges may be too old for their counts. A power of two: the processor
/// has no instruction that divides.
constexpr unsigned commits_per_wake = 64;

/// After this many commits an edge goes through the loop: once a second. If lower, more stamps to
/// look at; if higher, a fault is found out a second later.
constexpr unsigned commits_per_loop = 3'000;

/// The same until stamps are proved. If lower, more work while they cannot be; if higher, a start
/// takes longer.
constexpr unsigned commits_per_loop_at_start = 3;

constexpr bool is_set(std::uint32_t signals, std::uint8_t signal) {
    return (signals >> signal & 1U) != 0;
}

}  // namespace

[[gnu::always_inline]] inline void OutputPort::send(std::uint32_t cycle, Levels levels) {
    const std::uint32_t cycles = cycle - sent_;
    const std::uint32_t pins = levels.pins | (loop_.level ? 1U << (pin_loop - first_output) : 0U);
    machine_.send((cycles - sequencer::shortest_cycles) | pins << sequencer::delay_bits);
    light_.pass(cycles);
    light_.change(cycle, levels.light);
    sent_ = cycle;
    levels_ = levels;
}

void OutputPort::set_up() {
    MachinePins pins;
    pins.out = first_output;
    pins.out_count = scheduled_outputs;
    Shifting shifting;
    shifting.autopull = true;
    shifting.join_transmit = true;
    machine_.load(sequencer::code, sequencer::place);
    machine_.set_up(sequencer::place, pins, shifting);
    machine_.make_outputs(first_output, scheduled_outputs);
    machine_.execute(pio_assembly::jump(sequencer::place.first));
    send(ahead_cycles, {});
    machine_.execute(pio_assembly::pull());
    set_function(pin_loop, function_pio0);
    last_ = ahead;
    set_bits(timer().interrupt_enable, 1);
}

OutputPort::Levels OutputPort::levels_of(std::uint32_t signals) {
    Levels levels{};
    std::uint32_t pins = 0;
    for (const SignalPin& output : output_pins)
        pins |= (signals >> output.signal & 1U) << (output.pin - first_output);
    levels.pins = static_cast<std::uint16_t>(pins);
    if (is_set(signals, firmware::output_light_gate))
        levels.light = is_set(signals, firmware::output_light_lead) ? LightPort::State::lit
                                                                    : LightPort::State::follows;
    return levels;
}

/// What is due by then, or else a word that changes nothing: the sequencer always has something to
/// do.
[[gnu::always_inline]] inline void OutputPort::send_next(std::uint32_t until) {
    if (size_ == 0 || from(until, front().cycle) >= step_cycles) {
        if (commits_ >= loop_due_) send_through_loop(until);
        return send(until, levels_);
    }
    send(front().cycle, front().levels);
    first_ = (first_ + 1) % capacity;
    size_ = size_ - 1;
    if (wants_room_) wake_flag_.ask();
    wants_room_ = false;
}

void OutputPort::commit() {
    timer().raw_interrupts = 1;
    timer().alarms[0] = timer().low + commit_interval_us;
    if (++commits_ % commits_per_wake == 0) WakeFlag::wake();
    if (machine_.starved()) restart_at_once();  // the times of all words after are unknown
    const std::uint32_t until = clock_.low_cycles() + ahead_cycles;
    std::uint32_t waits_for = 0;
    while (waits_for == 0 && from(sent_, until) >= step_cycles) {
        if (machine_.is_full())
            waits_for = StateMachine::has_room_interrupt(sequencer::machine);
        else if (!light_.has_room())
            waits_for = StateMachine::has_room_interrupt(light::machine);
        else
            send_next(until);
    }
    if (waits_for == 0) light_.go_on();
    pio(0).interrupt1_enable = waits_for;
}

/// The next one is sent when this one has come back, or is given up.
void OutputPort::send_through_loop(std::uint32_t cycle) {
    if (loop_.awaited) return;
    loop_.level = !loop_.level;
    loop_.at_low_ns = cycle * cycle_ns;
    loop_.awaited = true;
    loop_due_ = commits_ + (loop_.proved ? commits_per_loop : commits_per_loop_at_start);
}

Nanoseconds OutputPort::push(Nanoseconds at, std::uint32_t levels) {
    const InterruptsOff undisturbed;
    if (size_ == capacity) {
        wants_room_ = true;
        return firmware::never;
    }
    return add(at, levels_of(levels));
}

Nanoseconds OutputPort::add(Nanoseconds at, Levels levels) {
    Nanoseconds& eighth_before = recent_[count_++ % fifo];
    const Nanoseconds sent = BoardClock::from_low_ns(sent_ * cycle_ns, clock_.now());
    const Nanoseconds soonest = later(later(sent, last_) + step, eighth_before + refill);
    last_ = eighth_before = later(at, soonest);
    words_[(first_ + size_) % capacity] = {BoardClock::cycle_of(last_), levels};
    size_ = size_ + 1;
    return last_;
}

Nanoseconds OutputPort::rest(std::uint32_t signals) {
    const InterruptsOff undisturbed;
    return add(0, levels_of(signals));
}

}  // namespace versavis::rp2040
