// SPDX-License-Identifier: BSD-3-Clause
// Sets a machine of the programmable I/O up.
#pragma once

#include <array>

#include "pio_programs.hpp"
#include "registers.hpp"

namespace versavis::rp2040 {

struct MachinePins {
    unsigned in = 0;
    unsigned out = 0;
    unsigned out_count = 0;
    unsigned side = 0;
    unsigned side_count = 0;  ///< with the bit that makes it optional
    bool side_optional = false;
    unsigned jump = 0;
};

struct Shifting {
    bool in_right = false;
    bool out_right = true;
    bool autopull = false;
    unsigned push_at = 0;  ///< bits that IN has shifted; 0: never by itself
    bool join_transmit = false;
    bool join_receive = false;
};

class StateMachine {
 public:
    StateMachine(unsigned block, unsigned machine) : pio_(pio(block)), index_(machine) {}

    template <std::size_t size>
    void load(const std::array<pio_assembly::Code, size>& code, const Place& place) {
        for (std::size_t i = 0; i < size; ++i) pio_.memory[place.first + i] = code[i];
    }

    void set_up(const Place& place, const MachinePins& pins, const Shifting& shifting) {
        PioMachine& machine = pio_.machines[index_];
        machine.divider = 1U << 16U;
        machine.execution = place.wrap_bottom << 7U | place.wrap_top << 12U | pins.jump << 24U |
                            (pins.side_optional ? 1U << 30U : 0U);
        machine.shift =
            (shifting.push_at > 0 ? 1U << 16U | shifting.push_at << 20U : 0U) |
            (shifting.autopull ? 1U << 17U : 0U) | (shifting.in_right ? 1U << 18U : 0U) |
            (shifting.out_right ? 1U << 19U : 0U) | (shifting.join_transmit ? 1U << 30U : 0U) |
            (shifting.join_receive ? 1U << 31U : 0U);
        machine.pins = pins.out | pins.side << 10U | pins.in << 15U | pins.out_count << 20U |
                       pins.side_count << 29U;
    }

    /// `pins` side by side, driven by this block when their function says so.
    void make_outputs(unsigned first, unsigned pins, bool level = false) {
        PioMachine& machine = pio_.machines[index_];
        const std::uint32_t before = machine.pins;
        for (unsigned pin = first; pin < first + pins; ++pin) {
            machine.pins = pin << 5U | 1U << 26U;
            execute(pio_assembly::set(pio_assembly::To::pin_directions, 1));
            execute(pio_assembly::set(pio_assembly::To::pins, level ? 1 : 0));
        }
        machine.pins = before;
    }

    /// At once, in place of the program.
    void execute(pio_assembly::Code code) { pio_.machines[index_].instruction = code; }

    void run() { set_bits(pio_.control, 1U << index_); }
    void stop() { clear_bits(pio_.control, 1U << index_); }

    void send(std::uint32_t word) { pio_.transmit[index_] = word; }
    bool is_full() const { return (pio_.fifo_status >> (16U + index_) & 1U) != 0; }
    std::uint32_t waiting() const { return pio_.fifo_level >> (8U * index_) & 15U; }

    /// It wanted a word and found none, since this was last forgotten.
    bool starved() const { return (pio_.fifo_debug >> (24U + index_) & 1U) != 0; }
    /// It had to wait for room.
    bool overflowed() const { return (pio_.fifo_debug >> index_ & 1U) != 0; }
    void forget_faults() { pio_.fifo_debug = 0x01010001U << index_; }

    static constexpr std::uint32_t has_room_interrupt(unsigned machine) {
        return 1U << (4U + machine);
    }

 private:
    Pio& pio_;
    unsigned index_;
};

inline void set_function(unsigned pin, Function function, Override input = override_none,
                         Override output = override_none) {
    io_bank().gpio[pin].control =
        function | output << output_override_shift | input << input_override_shift;
}

}  // namespace versavis::rp2040
