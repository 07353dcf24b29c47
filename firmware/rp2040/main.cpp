// SPDX-License-Identifier: BSD-3-Clause
// The firmware: sets the chip up, puts the core on it, and polls it when there is something to do.
#include <new>

#include "board.hpp"
#include "clocks.hpp"
#include "edge_port.hpp"
#include "flash_chip.hpp"
#include "imu_bus_port.hpp"
#include "output_port.hpp"
#include "reboot_port.hpp"
#include "routing_port.hpp"
#include "settings_store.hpp"
#include "start.hpp"
#include "uart_port.hpp"
#include "usb_device.hpp"

namespace versavis::rp2040 {

namespace {

/// A Pico has no pins left for it.
struct NoImuOutput final : firmware::ImuOutput {
    void publish(const firmware::ImuImage& /*image*/) override {}
};

constexpr std::uint32_t present = wire::present_all & ~std::uint32_t{wire::present_imu_output};

/// What the core and the bus keep up with. If lower, fast IMUs are refused; if higher, samples are
/// lost.
constexpr std::uint32_t fastest_imu_millihertz = 4'000'000;

struct Ports {
    BoardClock clock;
    WakeFlag wake_flag;
    LoopSignal loop;
    LightPort light{clock};
    OutputPort outputs{clock, wake_flag, light, loop};
    EdgePort edges{clock, loop};
    RoutingPort routing{clock, outputs, edges, light};
    ImuBusPort imu_bus{clock, edges, wake_flag};
    UartPort uart{clock, wake_flag};
    NoImuOutput imu_output;
    UsbLink link{clock, wake_flag};
    UsbDevice usb{link};
    FlashChip flash;
    SettingsStore store{flash};
    RebootPort reboot;
    WatchdogPort watchdog;

    firmware::Hal hal() {
        firmware::PortFacts facts;
        facts.present = present;
        facts.fastest_imu_millihertz = fastest_imu_millihertz;
        facts.output_grain_bits = OutputPort::grain_bits;
        facts.output_step = OutputPort::step;
        return {clock,      outputs, edges, routing, imu_bus,  uart,
                imu_output, link,    store, reboot,  watchdog, facts};
    }
};

// Interrupts reach them by these.
alignas(Ports) unsigned char ports_storage[sizeof(Ports)];
alignas(firmware::Board) unsigned char board_storage[sizeof(firmware::Board)];
Ports& ports() { return *std::launder(reinterpret_cast<Ports*>(ports_storage)); }

std::uint32_t random_word() {
    std::uint32_t word = timer().low;
    for (unsigned i = 0; i < 32; ++i) {
        word = word << 1U ^ (ring_oscillator().random_bit & 1U) ^ word >> 31U;
        for (volatile unsigned pause = 0; pause < 16; pause = pause + 1) {
        }
    }
    return word;
}

/// 16 digits of the flash chip's number, which no other has.
void name_board(FlashChip& flash, char (&serial)[17]) {
    std::uint8_t id[FlashChip::id_size];
    flash.read_id(id);
    for (unsigned i = 0; i < FlashChip::id_size; ++i) {
        serial[2 * i] = "0123456789ABCDEF"[id[i] >> 4U];
        serial[2 * i + 1] = "0123456789ABCDEF"[id[i] & 15U];
    }
    serial[16] = '\0';
}

void start_blocks() {
    restart_blocks(reset_io_bank0 | reset_pads_bank0 | reset_dma | reset_pio0 | reset_pio1);
    for (unsigned pin = 0; pin < pin_count; ++pin) {
        set_function(pin, function_none);
        pads().gpio[pin] = pad_input | pad_schmitt | pad_4_ma;
    }
    for (const unsigned pin : {pin_i2c_data, pin_i2c_clock})
        pads().gpio[pin] = pad_input | pad_schmitt | pad_4_ma | pad_pull_up;
    for (const unsigned pin : own_pins) pads().gpio[pin] = pad_schmitt | pad_4_ma | pad_pull_down;
}

void start_ports() {
    Ports& all = ports();
    all.light.set_up();
    all.outputs.set_up();
    all.edges.set_up();
    all.routing.set_up();
    all.imu_bus.set_up();
    all.uart.set_up();
    {
        const InterruptsOff undisturbed;
        all.clock.begin();
        const std::uint32_t machines =
            1U << sequencer::machine | 1U << watcher::machine | 1U << light::machine;
        set_bits(pio(0).control, machines | machines << pio_divider_restart_shift);
        all.clock.count_cycles();
    }
    enable_interrupt(interrupt_usb, 0);
    enable_interrupt(interrupt_gpio, 0);
    enable_interrupt(interrupt_timer1, 0);
    enable_interrupt(interrupt_dma1, 1);
    enable_interrupt(interrupt_i2c1, 1);
    enable_interrupt(interrupt_dma0, 1);
    enable_interrupt(interrupt_timer0, 1);
    enable_interrupt(interrupt_pio0_1, 1);
    enable_interrupt(interrupt_uart0, 2);
    enable_interrupt(interrupt_pio0, 2);
    enable_interrupt(interrupt_usb_work, 2);
    enable_interrupt(interrupt_timer3, 2);
    enable_interrupt(interrupt_timer2, 3);
    set_bits(timer().interrupt_enable, 1U << 2U | 1U << 3U);
    all.outputs.commit();
}

/// Asks for a poll at `next`. False: it is due, or the alarm may have been set too late for it.
bool set_alarm(Ports& all, Nanoseconds next) {
    constexpr Nanoseconds shortest = 2'000;
    constexpr Nanoseconds longest = 1'000'000'000;
    const Nanoseconds left = next - all.clock.now();
    if (left < shortest) return false;
    const std::uint32_t at =
        timer().low + static_cast<std::uint32_t>(left < longest ? left : longest) / 1000U;
    timer().alarms[2] = at;
    return static_cast<std::int32_t>(at - timer().low) > 0;
}

/// Until the core is to be polled.
void sleep(Ports& all) {
    for (;;) {
        if (all.edges.wants_attention()) return WakeFlag::wake();
        {
            // An interrupt that comes from here on ends the sleep, and is taken after it.
            const InterruptsOff undisturbed;
            if (all.wake_flag.asked()) return WakeFlag::wake();
            if (all.edges.has_changed()) continue;
            if (!all.store.is_storing()) WakeFlag::sleep_after_interrupts();
            __asm__ volatile("wfi" ::: "memory");
        }
        all.store.work();
    }
}

}  // namespace

extern "C" {

void firmware_main() {
    // Before anything can go wrong, and before clocks take their reason away.
    const wire::ResetCause cause = reset_cause();
    start_clocks();
    start_blocks();
    Ports& all = *new (ports_storage) Ports;
    all.watchdog.begin();
    all.flash.begin();
    char serial[17];
    name_board(all.flash, serial);
    firmware::Identity identity{};
    identity.nonce = random_word();
    identity.reset_cause = cause;
    for (unsigned i = 0; i < sizeof identity.serial; ++i) identity.serial[i] = serial[i];
    start_ports();
    auto& board = *new (board_storage) firmware::Board(all.hal(), identity);
    all.usb.begin(serial);
    for (;;) {
        all.wake_flag.forget();
        board.poll();
        if (set_alarm(all, board.next_wake())) sleep(all);
    }
}

void on_commit_time() { ports().outputs.commit(); }
void on_bus_time() { ports().imu_bus.time_reached(); }
void on_wake_time() {
    timer().raw_interrupts = 1U << 2U;
    ports().wake_flag.ask();
}
void on_usb_watch() { ports().usb.watch(); }
void on_usb() { ports().usb.note(); }
void on_usb_work() { ports().usb.work(); }
void on_change() {
    ports().edges.changed();
    WakeFlag::wake();
}
void on_ring_end() { ports().edges.count_run(); }
void on_bus_dma() { ports().imu_bus.transferred(); }
void on_data_ready() { ports().imu_bus.data_ready(); }
void on_uart() { ports().uart.moved(); }
void on_i2c() { ports().imu_bus.i2c_moved(); }
}

}  // namespace versavis::rp2040
