// SPDX-License-Identifier: BSD-3-Clause
#include "edge_port.hpp"

#include "clocks.hpp"
#include "dma_channels.hpp"

namespace versavis::rp2040 {

namespace {

/// Changes that a channel writes until it is started anew. At half, twice as many interrupts; at
/// twice, a test takes twice as long to get there.
constexpr std::uint32_t run = 1U << 16U;

/// From an edge at the pin to the count that stamps it, on average: the synchroniser, half of the
/// watcher's loop, its way to the strobe, half of the stamper's loop.
constexpr Nanoseconds stamp_delay = 13 * cycle_ns / 2;

/// A count may be so much newer than the clock that was read before it. At half and at twice the
/// same.
constexpr std::uint32_t newer_ticks = 1'000;

constexpr Nanoseconds tick_ns = stamper::tick_cycles * cycle_ns;

constexpr std::uint32_t pin_bit(unsigned pin) { return 1U << (pin - first_input); }

constexpr std::uint32_t ready_pins =
    pin_bit(pin_imu_ready0) | pin_bit(pin_imu_ready1) | pin_bit(pin_accel_ready);

constexpr std::uint32_t pins_of(std::uint32_t inputs) {
    std::uint32_t pins = 0;
    for (const SignalPin& input : input_pins)
        if ((inputs >> input.signal & 1U) != 0) pins |= pin_bit(input.pin);
    return pins;
}

constexpr std::array<std::uint8_t, watched_inputs> inputs_by_pin() {
    std::array<std::uint8_t, watched_inputs> inputs{};
    for (const SignalPin& input : input_pins) inputs[input.pin - first_input] = input.signal;
    return inputs;
}
constexpr std::array<std::uint8_t, watched_inputs> input_of = inputs_by_pin();

[[gnu::section(".rings")]] alignas(EdgePort::capacity * 4) std::uint32_t states[EdgePort::capacity];
[[gnu::section(".rings")]] alignas(EdgePort::capacity * 4) std::uint32_t counts[EdgePort::capacity];

constexpr unsigned ring_channels[2] = {dma_states, dma_counts};

}  // namespace

void EdgePort::set_up() {
    for (const SignalPin& input : input_pins) set_function(input.pin, function_none, override_low);
    set_up_machines();
    set_up_rings();
}

void EdgePort::set_up_machines() {
    Shifting shifting;
    shifting.join_receive = true;
    MachinePins pins;
    pins.in = first_input;
    pins.side = pin_strobe;
    pins.side_count = 1;
    watcher_.load(watcher::code, watcher::place);
    watcher_.set_up(watcher::place, pins, shifting);
    watcher_.make_outputs(pin_strobe, 1);
    watcher_.execute(pio_assembly::set(pio_assembly::To::y, 0));
    watcher_.execute(pio_assembly::jump(watcher::place.wrap_bottom));
    set_function(pin_strobe, function_pio0);
    // It comes from the same clock.
    set_bits(pio(0).bypass_synchroniser, 1U << pin_strobe);

    MachinePins strobe;
    strobe.jump = pin_strobe;
    stamper_.load(stamper::code, stamper::place);
    stamper_.set_up(stamper::place, strobe, shifting);
    stamper_.execute(pio_assembly::set(pio_assembly::To::x, 0));
    stamper_.execute(pio_assembly::jump(stamper::place.wrap_bottom));
}

void EdgePort::set_up_rings() {
    Register* const fifos[2] = {&pio(0).receive[watcher::machine],
                                &pio(0).receive[stamper::machine]};
    std::uint32_t* const rings[2] = {states, counts};
    const unsigned machines[2] = {watcher::machine, stamper::machine};
    for (unsigned i = 0; i < 2; ++i) {
        DmaChannel& channel = dma().channels[ring_channels[i]];
        channel.read_address = reinterpret_cast<std::uintptr_t>(fifos[i]);
        channel.write_address = reinterpret_cast<std::uintptr_t>(rings[i]);
        channel.count = run;
        channel.control_trigger = dma_enable | dma_words | dma_increment_write | dma_ring_on_write |
                                  dma_ring_bits(ring_bits) | dma_chain_to(ring_channels[i]) |
                                  dma_paced_by(request_pio0_receive0 + machines[i]);
    }
    dma().interrupt0_enable = 1U << dma_states | 1U << dma_counts;
    set_bits(pio(0).interrupt0_enable, 1U << (8U + watcher::flag));
}

void EdgePort::continue_rings() {
    const std::uint32_t ended = dma().interrupt0_status;
    for (unsigned i = 0; i < 2; ++i) {
        if ((ended >> ring_channels[i] & 1U) == 0) continue;
        dma().interrupt0_status = 1U << ring_channels[i];
        runs_[i] = runs_[i] + 1;
        dma().channels[ring_channels[i]].alias1_count_trigger = run;
    }
}

/// Words that a ring has got since the start.
std::uint32_t EdgePort::written(unsigned ring) const {
    for (;;) {
        const std::uint32_t runs = runs_[ring];
        const std::uint32_t left = dma().channels[ring_channels[ring]].count;
        if (runs == runs_[ring]) return runs * run + run - left;
    }
}

/// Changes whose state and stamp are in the rings, since the start.
std::uint32_t EdgePort::arrived() const {
    const std::uint32_t with_state = written(0);
    const std::uint32_t with_stamp = written(1) - stamps_ahead_;
    return static_cast<std::int32_t>(with_stamp - with_state) < 0 ? with_stamp : with_state;
}

void EdgePort::listen(std::uint32_t inputs) {
    const std::uint32_t pins = pins_of(inputs);
    const std::uint32_t changed = pins ^ listened_;
    listened_ = pins;
    apply(changed);
}

void EdgePort::invert(std::uint32_t inputs) {
    const std::uint32_t pins = pins_of(inputs);
    const std::uint32_t changed = pins ^ inverted_;
    inverted_ = pins;
    apply(changed);
}

/// Until what the watcher has seen by now is in them.
void EdgePort::wait_for_rings() const {
    const Nanoseconds begun = clock_.now();
    while (clock_.now() - begun <= 2 * known_after) {
    }
}

/// What the watcher sees of these pins is what it should, and what it has seen before is forgotten.
void EdgePort::apply(std::uint32_t pins) {
    if (pins == 0) return;
    for (unsigned i = 0; i < watched_inputs; ++i) {
        if ((pins >> i & 1U) == 0) continue;
        const Override seen = (listened_ >> i & 1U) == 0   ? override_low
                              : (inverted_ >> i & 1U) != 0 ? override_invert
                                                           : override_none;
        set_function(first_input + i, function_none, seen);
    }
    wait_for_rings();
    const std::uint32_t until = arrived();
    quiet_ |= pins;
    for (unsigned i = 0; i < watched_inputs; ++i)
        if ((pins >> i & 1U) != 0) quiet_until_[i] = until;
}

/// Pins that are quiet in the change of this index, which is the next to be read.
std::uint32_t EdgePort::quiet(std::uint32_t index) {
    for (unsigned i = 0; i < watched_inputs; ++i)
        if ((quiet_ >> i & 1U) != 0 && static_cast<std::int32_t>(index - quiet_until_[i]) >= 0)
            quiet_ &= ~(1U << i);
    return quiet_;
}

Nanoseconds EdgePort::time_of(std::uint32_t index) const {
    const std::uint32_t ticks = 0U - counts[(index + stamps_ahead_) % capacity];
    // When the change was looked at, which was soon after it.
    const std::uint64_t now = static_cast<std::uint64_t>(scanned_at_) / tick_ns + newer_ticks;
    const std::uint32_t ago = static_cast<std::uint32_t>(now) - ticks;
    return static_cast<Nanoseconds>(now - ago) * tick_ns - stamp_delay;
}

/// Looks at what is new: does it need attention, and did a data-ready input rise?
void EdgePort::scan() {
    // Most of the time there is nothing, which this tells without much work.
    const std::uint32_t left = dma().channels[dma_states].count + dma().channels[dma_counts].count;
    if (left == scanned_left_) return;
    scanned_left_ = left;
    scanned_at_ = clock_.now();
    const std::uint32_t end = arrived();
    if (watcher_.overflowed() || stamper_.overflowed() || end - read_ > capacity) return drop_all();
    for (; scanned_ != end; ++scanned_) {
        const std::uint32_t state = states[scanned_ % capacity];
        const std::uint32_t changed = (state ^ scanned_state_) & listened_;
        scanned_state_ = state;
        if ((changed & ~ready_pins) != 0) attention_ = true;
        std::uint32_t rises = changed & state & ready_pins & ~quiet_;
        for (unsigned i = 0; rises != 0; rises >>= 1U, ++i)
            if ((rises & 1U) != 0) rise_[i] = time_of(scanned_);
    }
    if (end - read_ > capacity / 2) attention_ = true;
}

/// Which edges are in the rings is no longer known: they begin anew.
void EdgePort::drop_all() {
    // From its loop on again, with the strobe low: what it was about to tell, it finds again.
    watcher_.stop();
    watcher_.execute(pio_assembly::side(pio_assembly::jump(watcher::place.wrap_bottom), 1, 0));
    wait_for_rings();
    lost_ += arrived() - read_ + 1;
    read_ = scanned_ = written(0);
    stamps_ahead_ = written(1) - read_;
    state_ = scanned_state_ = states[(read_ - 1) % capacity];
    changes_ = 0;
    attention_ = true;
    watcher_.forget_faults();
    stamper_.forget_faults();
    watcher_.run();
}

void EdgePort::take_change() {
    const std::uint32_t state = states[read_ % capacity];
    std::uint32_t changed = (state ^ state_) & listened_ & (state | ~ready_pins);
    if (quiet_ != 0) changed &= ~quiet(read_);
    if (changed != 0) changed_at_ = time_of(read_);
    state_ = state;
    changes_ = changed;
    ++read_;
}

bool EdgePort::pop(firmware::Edge& edge) {
    while (changes_ == 0) {
        if (read_ == scanned_) {
            settled_ = clock_.now() - known_after;
            scan();
        }
        if (read_ == scanned_) {
            attention_ = false;
            return false;
        }
        take_change();
    }
    unsigned pin = 0;
    while ((changes_ >> pin & 1U) == 0) ++pin;
    changes_ &= changes_ - 1;
    edge.at = changed_at_;
    edge.input = input_of[pin];
    edge.level = ((state_ ^ inverted_) >> pin & 1U) != 0;
    return true;
}

std::uint32_t EdgePort::take_lost() {
    const std::uint32_t lost = lost_;
    lost_ = 0;
    return lost;
}

void EdgePort::changed() {
    // Until the main loop has looked: a line that never rests must not keep it from doing so.
    clear_bits(pio(0).interrupt0_enable, 1U << (8U + watcher::flag));
}

bool EdgePort::wants_attention() {
    if (has_changed()) {
        pio(0).flags = 1U << watcher::flag;
        set_bits(pio(0).interrupt0_enable, 1U << (8U + watcher::flag));
    }
    scan();
    return attention_;
}

Nanoseconds EdgePort::last_rise(std::uint8_t input) {
    scan();
    return rise_[pin_of_input(input) - first_input];
}

}  // namespace versavis::rp2040
