// SPDX-License-Identifier: BSD-3-Clause
#include "imu_bus_port.hpp"

#include <cstring>

#include "clocks.hpp"
#include "dma_channels.hpp"
#include "i2c_registers.hpp"
#include "state_machine.hpp"

namespace versavis::rp2040 {

namespace {

using firmware::ImuReply;
using firmware::ImuTransfer;
using firmware::not_routed;
using Bus = ImuTransfer::Bus;

constexpr std::size_t word_size = 2;

/// Of the board's clock.
constexpr Nanoseconds clock_step = 1'000;

/// An I2C transfer that has not ended by then is given up. If lower, a part that stretches its
/// clock is; if higher, it is more than the HAL says.
constexpr Nanoseconds i2c_patience = 9'000'000;

/// An alarm this far ahead is not missed.
constexpr std::uint32_t alarm_margin_us = 2;

constexpr std::uint32_t alarm_bit = 1U << 1U;

constexpr std::uint32_t select_bit(std::uint8_t chip) {
    return 1U << (chip == 0 ? pin_spi_select0 : pin_spi_select1);
}

/// Less urgent than what asks for it.
void ask_for_i2c() { interrupt_controller().set_pending = 1U << interrupt_i2c1; }

void set_spi_clock(std::uint32_t hz) {
    constexpr std::uint32_t mode_3 = 1U << 7U | 1U << 6U;
    constexpr std::uint32_t bits_8 = 7;
    constexpr std::uint32_t most_steps = 256;
    // The clock is divided by prescale * steps; prescale is even.
    const std::uint32_t ratio = (clock_hz - 1) / hz + 1;
    std::uint32_t prescale = 2;
    while (prescale < 254 && ratio > prescale * most_steps) prescale += 2;
    std::uint32_t steps = (ratio + prescale - 1) / prescale;
    if (steps > most_steps) steps = most_steps;
    spi0().control1 = 0;
    spi0().prescale = prescale;
    spi0().control0 = mode_3 | bits_8 | (steps - 1) << 8U;
    spi0().control1 = 1U << 1U;
}

void set_up_i2c() {
    constexpr std::uint32_t master = 1U << 0U;
    constexpr std::uint32_t fast = 2U << 1U;
    constexpr std::uint32_t restart = 1U << 5U;
    constexpr std::uint32_t no_slave = 1U << 6U;
    constexpr std::uint32_t empty_at_end = 1U << 8U;
    // Of 125 MHz: 1.5 us low, 1.0 us high and data that hold for 0.3 us make 400 kHz.
    restart_blocks(reset_i2c1);
    i2c1().enable = 0;
    i2c1().control = master | fast | restart | no_slave | empty_at_end;
    i2c1().fast_low = 188;
    i2c1().fast_high = 124;
    i2c1().hold = 38;
    i2c1().receive_threshold = 0;
    i2c1().transmit_threshold = 0;
    i2c1().interrupt_mask = 0;
}

enum I2cInterrupt : std::uint32_t {
    i2c_received = 1U << 2U,
    i2c_wants_more = 1U << 4U,
    i2c_aborted = 1U << 6U,
    i2c_stopped = 1U << 9U,
};

constexpr unsigned i2c_fifo = 16;

DmaChannel& transmit_channel() { return dma().channels[dma_spi_transmit]; }
DmaChannel& receive_channel() { return dma().channels[dma_spi_receive]; }

Nanoseconds later(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }

}  // namespace

void ImuBusPort::set_up() {
    set_function(pin_spi_receive, function_spi);
    sio().out_set = 1U << pin_spi_select0 | 1U << pin_spi_select1;
    sio().enable_set = 1U << pin_spi_select0 | 1U << pin_spi_select1;
    for (const unsigned pin : {pin_spi_select0, pin_spi_select1}) set_function(pin, function_sio);
    set_up_i2c();
    set_up_spi();
    transmit_channel().write_address = reinterpret_cast<std::uintptr_t>(&spi0().data);
    transmit_channel().alias1_control = dma_enable | dma_bytes | dma_increment_read |
                                        dma_chain_to(dma_spi_transmit) |
                                        dma_paced_by(request_spi0_transmit);
    receive_channel().read_address = reinterpret_cast<std::uintptr_t>(&spi0().data);
    receive_channel().alias1_control = dma_enable | dma_bytes | dma_increment_write |
                                       dma_chain_to(dma_spi_receive) |
                                       dma_paced_by(request_spi0_receive);
    dma().interrupt1_enable = 1U << dma_spi_receive;
    set_bits(timer().interrupt_enable, alarm_bit);
}

/// As after a reset: nothing of an earlier transfer is left.
void ImuBusPort::set_up_spi() {
    constexpr std::uint32_t both_directions = 3;
    restart_blocks(reset_spi0);
    spi0().dma = both_directions;
    spi_hz_ = 0;
}

// From a data-ready edge to its transfer nothing is called: each call takes up to 20 cycles, and
// the interrupt is to take no more than 125.

[[gnu::always_inline]] inline void ImuBusPort::begin_part() {
    sio().out_clear = select_bit_;
    dma().trigger = 1U << dma_spi_transmit | 1U << dma_spi_receive;
    in_gap_ = false;
}

/// SPI begins here and now; I2C takes longer than more urgent interrupts may wait.
[[gnu::always_inline]] inline void ImuBusPort::begin() {
    started_us_ = timer().low;
    if (select_bit_ != 0) {
        begin_part();
    } else {
        i2c_asks_ = I2cAsks::begin;
        ask_for_i2c();
    }
    state_ = State::transfers;
    pausing_ = false;
}

/// The pause since the transfer before has passed, or is waited for.
[[gnu::always_inline]] inline void ImuBusPort::begin_when_free() {
    if (!pausing_ || clock_.now() >= free_at_) return begin();
    wait_until(free_at_);
}

/// The pin that starts the job; its edges since they were last forgotten are latched.
void ImuBusPort::choose_edge(unsigned pin) {
    edge_bank_ = pin / 8;
    edge_bit_ = gpio_rises << (pin % 8 * 4);
}
bool ImuBusPort::edge_latched() const { return (io_bank().latched[edge_bank_] & edge_bit_) != 0; }
[[gnu::always_inline]] inline void ImuBusPort::forget_edge() {
    io_bank().latched[edge_bank_] = edge_bit_;
}

void ImuBusPort::watch_edge(bool watch) {
    Register& enable = io_bank().interrupt_enable[edge_bank_];
    if (watch)
        set_bits(enable, edge_bit_);
    else
        clear_bits(enable, edge_bit_);
}

bool ImuBusPort::arm(const firmware::ImuJob& job) {
    const bool free = state_ == State::idle || (state_ == State::done && taken_ == job_.count);
    if (!free) return false;
    state_ = State::idle;
    copy_job(job);
    index_ = taken_ = 0;
    pausing_ = clock_.now() < free_at_;
    prepare();
    if (job.input == not_routed) {
        const InterruptsOff undisturbed;
        begin_no_sooner_than(job.after);
        return true;
    }
    choose_edge(pin_of_input(job.input));
    // One that came before may be the one that is waited for, or be so new that it is not known.
    Nanoseconds rise = firmware::never;
    if (edge_latched()) {
        forget_edge();
        rise = edges_.last_rise(job.input);
        const Nanoseconds begun = clock_.now();
        while ((rise == firmware::never || rise <= job.after) &&
               clock_.now() - begun <= EdgePort::known_after)
            rise = edges_.last_rise(job.input);
    }
    const InterruptsOff undisturbed;
    if (rise != firmware::never && rise > job.after) {
        forget_edge();
        begin_when_free();
    } else {
        state_ = State::waits_for_edge;
        watch_edge(true);
    }
    return true;
}

/// Only what is used: most of a job is room.
void ImuBusPort::copy_job(const firmware::ImuJob& job) {
    job_.pause = job.pause;
    job_.count = job.count;
    for (unsigned i = 0; i < job.count; ++i) {
        constexpr std::size_t head = offsetof(ImuTransfer, bytes);
        std::memcpy(&job_.transfers[i], &job.transfers[i], head + job.transfers[i].size);
    }
}

bool ImuBusPort::take_reply(ImuReply& out) {
    if (state_ != State::done || taken_ == job_.count) return false;
    const std::size_t size = job_.transfers[taken_].size;
    std::memcpy(&out, &replies_[taken_++], offsetof(ImuReply, bytes) + size);
    return true;
}

void ImuBusPort::disarm() {
    const InterruptsOff undisturbed;
    watch_edge(false);
    cancel_alarm();
    if (state_ == State::transfers) {
        dma().abort = 1U << dma_spi_transmit | 1U << dma_spi_receive;
        while (dma().abort != 0) {
        }
        dma().interrupt1_status = 1U << dma_spi_receive;
        sio().out_set = select_bit(0) | select_bit(1);
        if (is_spi())
            set_up_spi();
        else
            set_up_i2c();
        pause_from(clock_.now() + clock_step);
    }
    state_ = State::idle;
    job_.count = 0;
    in_gap_ = false;
    i2c_asks_ = I2cAsks::nothing;
}

void ImuBusPort::data_ready() {
    // First of all what the part waits for.
    if (state_ == State::waits_for_edge) begin_when_free();
    forget_edge();
    watch_edge(false);
}

/// For the time that the job says.
void ImuBusPort::pause_from(Nanoseconds at) {
    free_at_ = at + job_.pause;
    pausing_ = true;
}

void ImuBusPort::begin_no_sooner_than(Nanoseconds at) {
    if (clock_.now() >= at) return begin_when_free();
    wait_until(later(at, free_at_));
}

void ImuBusPort::wait_until(Nanoseconds at) {
    const InterruptsOff undisturbed;
    state_ = State::waits_for_time;
    set_alarm(at);
}

/// One of an earlier time no longer counts.
void ImuBusPort::set_alarm(Nanoseconds at) {
    alarm_at_ = at;
    // Far ones come in steps: an alarm knows but 32 bits.
    constexpr Nanoseconds furthest = 1'000'000'000;
    const std::uint32_t now_us = timer().low;
    const Nanoseconds ahead = at - clock_.at(now_us);
    std::uint32_t steps = alarm_margin_us;
    alarm_is_step_ = ahead > furthest;
    if (alarm_is_step_)
        steps = furthest / 1000;
    else if (ahead > alarm_margin_us * 1000)
        steps = (static_cast<std::uint32_t>(ahead) + 999) / 1000;
    timer().alarms[1] = now_us + steps;
    timer().raw_interrupts = alarm_bit;
}

void ImuBusPort::cancel_alarm() {
    timer().armed = alarm_bit;
    timer().raw_interrupts = alarm_bit;
}

void ImuBusPort::time_reached() {
    if ((timer().interrupt_status & alarm_bit) == 0) return;  // of a time that no longer counts
    timer().raw_interrupts = alarm_bit;
    if (alarm_is_step_) return set_alarm(alarm_at_);
    if (state_ == State::waits_for_time) return begin();
    if (state_ != State::transfers) return;
    if (in_gap_) return begin_part();
    if (is_spi()) return;
    i2c_asks_ = I2cAsks::end;
    ask_for_i2c();
}

/// Until the first transfer they are inputs: the part may be on either bus.
void ImuBusPort::use_shared_pins(Function function) {
    if (shared_pins_ == function) return;
    shared_pins_ = function;
    for (const unsigned pin : {pin_i2c_data, pin_i2c_clock}) set_function(pin, function);
}

/// All that can be done before the transfer begins.
void ImuBusPort::prepare() {
    position_ = 0;
    reply().refused = false;
    select_bit_ = is_spi() ? select_bit(transfer().chip) : 0;
    use_shared_pins(is_spi() ? function_spi : function_i2c);
    if (select_bit_ == 0) return;
    if (transfer().clock_hz != spi_hz_) {
        spi_hz_ = transfer().clock_hz;
        set_spi_clock(spi_hz_);
    }
    prepare_part();
}

/// All of the transfer, or with gaps its next word.
void ImuBusPort::prepare_part() {
    const std::size_t left = transfer().size - position_;
    part_ = transfer().word_gap_ns != 0 && left > word_size ? word_size : left;
    transmit_channel().read_address =
        reinterpret_cast<std::uintptr_t>(transfer().bytes + position_);
    transmit_channel().count = part_;
    receive_channel().write_address = reinterpret_cast<std::uintptr_t>(reply().bytes + position_);
    receive_channel().count = part_;
}

void ImuBusPort::transferred() {
    dma().interrupt1_status = 1U << dma_spi_receive;
    if (state_ != State::transfers) return;
    sio().out_set = select_bit_;
    position_ += part_;
    if (position_ == transfer().size) return end_transfer();
    prepare_part();
    const InterruptsOff undisturbed;
    in_gap_ = true;
    set_alarm(clock_.now() + transfer().word_gap_ns);
}

void ImuBusPort::end_transfer() {
    // The clock is up to one step behind: with it, no transfer seems to start before its edge.
    const std::uint32_t ended_us = timer().low;
    const Nanoseconds ended = clock_.at(ended_us) + clock_step;
    reply().started = ended - Nanoseconds{ended_us - started_us_} * 1000;
    reply().ended = ended;
    pause_from(ended);
    if (++index_ == job_.count) {
        state_ = State::done;
        return wake_flag_.ask();
    }
    prepare();
    begin_when_free();
}

void ImuBusPort::begin_i2c() {
    started_us_ = timer().low;
    received_ = 0;
    reply().bytes[0] = transfer().bytes[0];
    i2c1().enable = 0;
    i2c1().target = transfer().chip;
    i2c1().enable = 1;
    static_cast<void>(i2c1().clear_all);
    {
        const InterruptsOff undisturbed;
        set_alarm(clock_.now() + i2c_patience);
        i2c_asks_ = I2cAsks::nothing;
    }
    feed_i2c();
}

void ImuBusPort::feed_i2c() {
    constexpr std::uint32_t read = 1U << 8U;
    constexpr std::uint32_t stop = 1U << 9U;
    constexpr std::uint32_t restart = 1U << 10U;
    const bool reads = transfer().bus == Bus::i2c_read;
    while (position_ < transfer().size && i2c1().transmit_level < i2c_fifo &&
           (!reads || position_ < received_ + i2c_fifo)) {
        std::uint32_t word = reads && position_ > 0 ? read : transfer().bytes[position_];
        if (reads && position_ == 1) word |= restart;
        if (++position_ == transfer().size) word |= stop;
        i2c1().data = word;
    }
    const bool more = position_ < transfer().size;
    i2c1().interrupt_mask = i2c_received | i2c_aborted | i2c_stopped |
                            (more && !reads ? std::uint32_t{i2c_wants_more} : 0U);
}

void ImuBusPort::i2c_moved() {
    const std::uint32_t causes = i2c1().interrupts;
    if (state_ != State::transfers) {
        i2c1().interrupt_mask = 0;
        return;
    }
    if (i2c_asks_ == I2cAsks::begin) return begin_i2c();
    if (i2c_asks_ == I2cAsks::end) return end_i2c(true);
    while (i2c1().receive_level > 0 && received_ + 1 < transfer().size)
        reply().bytes[++received_] = static_cast<std::uint8_t>(i2c1().data);
    if ((causes & i2c_aborted) != 0) return end_i2c(true);
    if ((causes & i2c_stopped) != 0) return end_i2c(false);
    feed_i2c();
}

void ImuBusPort::end_i2c(bool refused) {
    i2c1().interrupt_mask = 0;
    static_cast<void>(i2c1().clear_all);
    cancel_alarm();
    i2c_asks_ = I2cAsks::nothing;
    reply().refused = refused;
    if (refused) set_up_i2c();
    end_transfer();
}

}  // namespace versavis::rp2040
