// SPDX-License-Identifier: BSD-3-Clause
#include "output_port.hpp"

#include "clocks.hpp"
#include "start.hpp"

namespace versavis::rp2040 {

namespace {

/// How often words are sent. At half, it takes twice the processor's time; at twice, the sequencer
/// runs dry, as it does after an interrupt that is held up for 50 us.
constexpr std::uint32_t commit_interval_us = 250;

/// How far ahead they are sent: a word leaves no sooner after it was pushed. At half, the sequencer
/// runs dry; at twice, the core comes too late.
constexpr Nanoseconds ahead = 300'000;

/// Within that time after a word has left, its room in the sequencer's FIFO is taken again. At
/// half, an interrupt that is held up makes words late without telling; at twice, more of eight
/// words that are close together are moved.
constexpr Nanoseconds refill = 5'000;

Nanoseconds later(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }

/// Bits of the sequencer's word by those of the HAL.
constexpr std::uint32_t pin_levels(std::uint32_t levels) {
    std::uint32_t pins = 0;
    for (const SignalPin& output : output_pins)
        pins |= (levels >> output.signal & 1U) << (output.pin - first_output);
    return pins;
}

}  // namespace

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
    send(ahead, 0);
    machine_.execute(pio_assembly::pull());
    last_ = sent_;
    set_bits(timer().interrupt_enable, 1);
}

void OutputPort::send(Nanoseconds at, std::uint32_t levels) {
    const std::uint32_t cycles = static_cast<std::uint32_t>(at - sent_) / cycle_ns;
    machine_.send((cycles - sequencer::shortest_cycles) | levels << sequencer::delay_bits);
    sent_ = at;
    levels_ = levels;
}

void OutputPort::commit() {
    timer().raw_interrupts = 1;
    timer().alarms[0] = timer().low + commit_interval_us;
    if (machine_.starved()) restart_at_once();  // the times of all words after are unknown
    const Nanoseconds until = clock_.now() + ahead;
    bool more = false;
    while (!more && sent_ + step <= until) {
        more = machine_.is_full();
        if (!more) send_next(until);
    }
    constexpr std::uint32_t has_room = StateMachine::has_room_interrupt(sequencer::machine);
    if (more)
        set_bits(pio(0).interrupt1_enable, has_room);
    else
        clear_bits(pio(0).interrupt1_enable, has_room);
}

/// What is due by then, or else a word that changes nothing: the sequencer always has something to
/// do.
void OutputPort::send_next(Nanoseconds until) {
    if (size_ == 0 || front().at >= until + step) return send(until, levels_);
    send(front().at, front().levels);
    first_ = (first_ + 1) % capacity;
    size_ = size_ - 1;
    if (wants_room_) attention_.ask();
    wants_room_ = false;
}

Nanoseconds OutputPort::push(Nanoseconds at, std::uint32_t levels) {
    const InterruptsOff undisturbed;
    if (size_ == capacity) {
        wants_room_ = true;
        return firmware::never;
    }
    return add(at, pin_levels(levels));
}

Nanoseconds OutputPort::add(Nanoseconds at, std::uint32_t levels) {
    Nanoseconds& eighth_before = recent_[count_++ % fifo];
    const Nanoseconds soonest = later(later(sent_, last_) + step, eighth_before + refill);
    last_ = eighth_before = later(at, soonest);
    words_[(first_ + size_) % capacity] = {last_, levels};
    size_ = size_ + 1;
    return last_;
}

Nanoseconds OutputPort::rest(std::uint32_t levels) {
    const InterruptsOff undisturbed;
    return add(0, pin_levels(levels));
}

}  // namespace versavis::rp2040
