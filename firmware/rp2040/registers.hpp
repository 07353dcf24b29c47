// SPDX-License-Identifier: BSD-3-Clause
// The registers of the RP2040 that this port uses, as its data sheet lays them out.
#pragma once

#include <cstddef>
#include <cstdint>

namespace versavis::rp2040 {

using Register = volatile std::uint32_t;

/// Each peripheral can be written so that only the given bits are set, or cleared, at once.
inline Register& alias(Register& of, std::uintptr_t offset) {
    return *reinterpret_cast<Register*>(reinterpret_cast<std::uintptr_t>(&of) + offset);
}
inline void set_bits(Register& of, std::uint32_t bits) { alias(of, 0x2000) = bits; }
inline void clear_bits(Register& of, std::uint32_t bits) { alias(of, 0x3000) = bits; }

template <class Block>
Block& block_at(std::uintptr_t address) {
    return *reinterpret_cast<Block*>(address);
}

// Resets

struct Resets {
    Register reset, watchdog_select, done;
};
inline Resets& resets() { return block_at<Resets>(0x4000C000); }

enum ResetBit : std::uint32_t {
    reset_dma = 1U << 2U,
    reset_i2c1 = 1U << 4U,
    reset_io_bank0 = 1U << 5U,
    reset_pads_bank0 = 1U << 8U,
    reset_pio0 = 1U << 10U,
    reset_pio1 = 1U << 11U,
    reset_pll_sys = 1U << 12U,
    reset_pll_usb = 1U << 13U,
    reset_spi0 = 1U << 16U,
    reset_timer = 1U << 21U,
    reset_uart0 = 1U << 22U,
    reset_usb = 1U << 24U,
};

/// Puts blocks into their reset state, and takes them out of it.
inline void restart_blocks(std::uint32_t bits) {
    set_bits(resets().reset, bits);
    clear_bits(resets().reset, bits);
    while ((resets().done & bits) != bits) {
    }
}

// Clocks

struct ClockGenerator {
    Register control, divider, selected;
};
struct Clocks {
    ClockGenerator outputs[4];
    ClockGenerator reference, system, peripherals, usb, adc, rtc;
    Register resuscitate;
};
inline Clocks& clocks() { return block_at<Clocks>(0x40008000); }

struct Oscillator {
    Register control, status, dormant, startup;
};
inline Oscillator& crystal() { return block_at<Oscillator>(0x40024000); }

struct RingOscillator {
    Register control, frequency_a, frequency_b, dormant, divider, phase, status, random_bit;
};
inline RingOscillator& ring_oscillator() { return block_at<RingOscillator>(0x40060000); }

struct Pll {
    Register control, power, feedback, post_dividers;
};
inline Pll& pll_sys() { return block_at<Pll>(0x40028000); }
inline Pll& pll_usb() { return block_at<Pll>(0x4002C000); }

// Pins

struct Gpio {
    Register status, control;
};
struct IoBank {
    Gpio gpio[30];
    Register latched[4];           ///< edges of 8 pins each, 4 bits a pin; written: forgets them
    Register interrupt_enable[4];  ///< of processor 0
    Register interrupt_force[4];
    Register interrupt_status[4];
};
inline IoBank& io_bank() { return block_at<IoBank>(0x40014000); }
inline constexpr std::uint32_t gpio_rises = 1U << 3U;
/// Of `status`: the level that peripherals see.
inline constexpr std::uint32_t gpio_seen = 1U << 19U;

struct IoQspi {
    Gpio clock, select, data[4];  ///< a reset leaves them without a function
};
inline IoQspi& io_qspi() { return block_at<IoQspi>(0x40018000); }

struct Pads {
    Register voltage;
    Register gpio[30];
};
inline Pads& pads() { return block_at<Pads>(0x4001C000); }

enum Function : std::uint32_t {
    function_flash = 0,  ///< of IO_QSPI
    function_spi = 1,
    function_uart = 2,
    function_i2c = 3,
    function_sio = 5,
    function_pio0 = 6,
    function_pio1 = 7,
    function_none = 31,
};
inline constexpr unsigned output_override_shift = 8;
inline constexpr unsigned input_override_shift = 16;
enum Override : std::uint32_t {
    override_none = 0,
    override_invert = 1,
    override_low = 2,
    override_high = 3
};

enum PadBit : std::uint32_t {
    pad_fast = 1U << 0U,
    pad_schmitt = 1U << 1U,
    pad_pull_down = 1U << 2U,
    pad_pull_up = 1U << 3U,
    pad_4_ma = 1U << 4U,
    pad_input = 1U << 6U,
    pad_output_off = 1U << 7U,
};

struct Sio {
    Register processor, in, in_qspi, reserved0, out, out_set, out_clear, out_invert, enable,
        enable_set, enable_clear, enable_invert;
};
inline Sio& sio() { return block_at<Sio>(0xD0000000); }

// Programmable I/O

struct PioMachine {
    Register divider, execution, shift, address, instruction, pins;
};
struct Pio {
    Register control, fifo_status, fifo_debug, fifo_level;
    Register transmit[4];
    Register receive[4];
    Register flags, force_flags, bypass_synchroniser, pad_out, pad_enable, facts;
    Register memory[32];
    PioMachine machines[4];
    Register raw_interrupts, interrupt0_enable, interrupt0_force, interrupt0_status;
    Register interrupt1_enable, interrupt1_force, interrupt1_status;
};
inline Pio& pio(unsigned index) { return block_at<Pio>(0x50200000 + index * 0x100000); }
static_assert(offsetof(Pio, machines) == 0xC8 && offsetof(Pio, raw_interrupts) == 0x128);

inline constexpr unsigned pio_restart_shift = 4;
inline constexpr unsigned pio_divider_restart_shift = 8;

// Direct memory access

struct DmaChannel {
    Register read_address, write_address, count, control_trigger;
    Register alias1_control, alias1_read, alias1_write, alias1_count_trigger;
    Register more_aliases[8];
};
struct Dma {
    DmaChannel channels[12];
    Register reserved[64];
    Register raw_interrupts, interrupt0_enable, interrupt0_force, interrupt0_status;
    Register reserved1, interrupt1_enable, interrupt1_force, interrupt1_status;
    Register reserved2[4];
    Register trigger;
    Register reserved3[4];
    Register abort;
};
inline Dma& dma() { return block_at<Dma>(0x50000000); }
static_assert(offsetof(Dma, raw_interrupts) == 0x400 && offsetof(Dma, trigger) == 0x430 &&
              offsetof(Dma, abort) == 0x444);

enum DmaBit : std::uint32_t {
    dma_enable = 1U << 0U,
    dma_bytes = 0U << 2U,
    dma_words = 2U << 2U,
    dma_increment_read = 1U << 4U,
    dma_increment_write = 1U << 5U,
    dma_ring_on_write = 1U << 10U,
    dma_busy = 1U << 24U,
};
inline constexpr std::uint32_t dma_ring_bits(unsigned bits) { return bits << 6U; }
/// A channel that is chained to itself chains to none.
inline constexpr std::uint32_t dma_chain_to(unsigned channel) { return channel << 11U; }
inline constexpr std::uint32_t dma_paced_by(unsigned request) { return request << 15U; }
inline constexpr unsigned request_pio0_receive0 = 4;
inline constexpr unsigned request_spi0_transmit = 16;
inline constexpr unsigned request_spi0_receive = 17;

// Time

struct Timer {
    Register write_high, write_low, latched_high, latched_low;
    Register alarms[4];
    Register armed, high, low, debug_pause, pause;
    Register raw_interrupts, interrupt_enable, interrupt_force, interrupt_status;
};
inline Timer& timer() { return block_at<Timer>(0x40054000); }
static_assert(offsetof(Timer, high) == 0x24 && offsetof(Timer, raw_interrupts) == 0x34);

struct WatchdogTimer {
    Register control, load, reason;
    Register scratch[8];
    Register tick;
};
inline WatchdogTimer& watchdog_timer() { return block_at<WatchdogTimer>(0x40058000); }
inline constexpr std::uint32_t watchdog_enable = 1U << 30U;
inline constexpr std::uint32_t watchdog_trigger = 1U << 31U;

struct PowerOnStates {
    Register force_on, force_off, watchdog_select, done;
};
inline PowerOnStates& power_on_states() { return block_at<PowerOnStates>(0x40010000); }

struct Regulator {
    Register voltage, brown_out, chip_reset;
};
inline Regulator& regulator() { return block_at<Regulator>(0x40064000); }

// Serial buses

struct Spi {
    Register control0, control1, data, status, prescale, interrupt_mask, raw_interrupts, interrupts,
        interrupt_clear, dma;
};
inline Spi& spi0() { return block_at<Spi>(0x4003C000); }

struct Uart {
    Register data, error;
    Register reserved0[4];
    Register flags;
    Register reserved1[2];
    Register divisor, fraction, line, control, levels, interrupt_mask, raw_interrupts, interrupts,
        interrupt_clear, dma;
};
inline Uart& uart0() { return block_at<Uart>(0x40034000); }
static_assert(offsetof(Uart, flags) == 0x18 && offsetof(Uart, divisor) == 0x24);

struct FlashInterface {
    Register control0, control1, enable, microwire, select, baud;
    Register transmit_threshold, receive_threshold, transmit_level, receive_level, status;
    Register interrupts[13];
    Register data;
};
inline FlashInterface& flash_interface() { return block_at<FlashInterface>(0x18000000); }
static_assert(offsetof(FlashInterface, data) == 0x60);

// USB

struct UsbRegisters {
    Register address, endpoints[15];
    Register control, start_of_frame_write, start_of_frame, serial_control, serial_status;
    Register interrupt_endpoints, buffer_status, buffer_to_handle, abort, abort_done;
    Register stall_arm, nak_poll, stall_nak, muxing, power, direct, direct_override, trim;
    Register reserved;
    Register raw_interrupts, interrupt_enable, interrupt_force, interrupt_status;
};
inline UsbRegisters& usb_registers() { return block_at<UsbRegisters>(0x50110000); }
static_assert(offsetof(UsbRegisters, control) == 0x40 &&
              offsetof(UsbRegisters, buffer_status) == 0x58 &&
              offsetof(UsbRegisters, muxing) == 0x74 &&
              offsetof(UsbRegisters, raw_interrupts) == 0x8C);

struct UsbEndpoint {
    Register in, out;
};
struct UsbMemory {
    volatile std::uint8_t setup[8];
    UsbEndpoint controls[15];  ///< of endpoint 1 and the next
    UsbEndpoint buffers[16];
    volatile std::uint8_t data0[64];  ///< of endpoint 0
    volatile std::uint8_t reserved[64];
    volatile std::uint8_t data[0xE80];
};
inline UsbMemory& usb_memory() { return block_at<UsbMemory>(0x50100000); }
static_assert(offsetof(UsbMemory, buffers) == 0x80 && offsetof(UsbMemory, data) == 0x180);

// Processor

struct InterruptController {
    Register enable;
    Register reserved0[31];
    Register disable;
    Register reserved1[31];
    Register set_pending;
    Register reserved2[31];
    Register clear_pending;
    Register reserved3[95];
    Register priorities[8];
};
inline InterruptController& interrupt_controller() {
    return block_at<InterruptController>(0xE000E100);
}
static_assert(offsetof(InterruptController, priorities) == 0x300);

inline Register& system_control() { return block_at<Register>(0xE000ED10); }
inline constexpr std::uint32_t sleep_on_exit = 1U << 1U;

inline Register& vector_table_address() { return block_at<Register>(0xE000ED08); }

enum Interrupt : unsigned {
    interrupt_timer0 = 0,
    interrupt_timer1 = 1,
    interrupt_timer2 = 2,
    interrupt_timer3 = 3,
    interrupt_usb = 5,
    interrupt_pio0 = 7,
    interrupt_pio0_1 = 8,
    interrupt_dma0 = 11,
    interrupt_dma1 = 12,
    interrupt_gpio = 13,
    interrupt_uart0 = 20,
    interrupt_i2c1 = 24,
    interrupt_usb_work = 26,  ///< no hardware: code asks for it
    interrupt_count = 32,
};

/// 0 is the most urgent, 3 the least.
inline void enable_interrupt(Interrupt interrupt, unsigned priority) {
    Register& word = interrupt_controller().priorities[interrupt / 4];
    const unsigned shift = interrupt % 4 * 8 + 6;
    word = (word & ~(3U << shift)) | priority << shift;
    interrupt_controller().enable = 1U << interrupt;
}

/// No interrupt comes while it lives.
struct CycleCounter {
    Register control, reload, current;
};
inline CycleCounter& cycle_counter() { return block_at<CycleCounter>(0xE000E010); }

class InterruptsOff {
 public:
    InterruptsOff() { __asm__ volatile("mrs %0, primask\n cpsid i" : "=r"(before_)::"memory"); }
    ~InterruptsOff() { __asm__ volatile("msr primask, %0" ::"r"(before_) : "memory"); }
    InterruptsOff(const InterruptsOff&) = delete;
    InterruptsOff& operator=(const InterruptsOff&) = delete;

 private:
    std::uint32_t before_;
};

}  // namespace versavis::rp2040
