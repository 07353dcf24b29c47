// SPDX-License-Identifier: BSD-3-Clause
#include "edge_port.hpp"

#include "clocks.hpp"
#include "dma_channels.hpp"
#include "start.hpp"

namespace versavis::rp2040 {

namespace {

/// Words that a channel writes until the other one goes on. If lower, more interrupts; if higher, a
/// test takes longer to get there.
constexpr std::uint32_t run = 1U << 16U;

/// Largest error of the stamp of a loop edge. If lower, good stamps fail; if higher, a stamp that
/// is off by a sample is not noticed.
constexpr std::int32_t loop_tolerance = 48;

/// An edge through the loop that has not come by then does not come. If lower, one may be under
/// way; if higher, a fault is found out later.
constexpr std::int32_t loop_patience = 100'000;

/// Edges that must come back before stamps are trusted. If lower, edges that are off by another
/// time may be right by chance; if higher, a start takes longer.
constexpr unsigned loops_to_trust = 8;

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

std::int32_t since(std::uint32_t at, std::uint32_t now) {
    return static_cast<std::int32_t>(now - at);
}

constexpr std::uint32_t loop_bit = pin_bit(pin_loop);

[[gnu::section(".rings")]] alignas(EdgePort::capacity * 4) std::uint32_t words[EdgePort::capacity];

constexpr unsigned ring_channels[2] = {dma_edges0, dma_edges1};

}  // namespace

/// Words that the ring has got since the start.
[[gnu::always_inline]] inline std::uint32_t EdgePort::written() const {
    for (;;) {
        const std::uint32_t runs = runs_;
        const std::uint32_t left = dma().channels[ring_channels[runs % 2]].count;
        if (runs == runs_) return runs * run + run - left;
    }
}

/// What the ring had at this index is no longer there.
[[gnu::always_inline]] inline bool EdgePort::overwritten(std::uint32_t index) const {
    return written() - index > capacity;
}

void EdgePort::set_up() {
    for (const SignalPin& input : input_pins) set_function(input.pin, function_none, override_low);
    set_up_machine();
    set_up_ring();
}

void EdgePort::set_up_machine() {
    Shifting shifting;
    shifting.join_receive = true;
    shifting.push_at = watched_pins;
    MachinePins pins;
    pins.in = first_input;
    watcher_.load(watcher::code, watcher::place);
    watcher_.set_up(watcher::place, pins, shifting);
    for (const pio_assembly::To counter : {pio_assembly::To::x, pio_assembly::To::y})
        watcher_.execute(pio_assembly::set(counter, 0));
    watcher_.execute(pio_assembly::jump(watcher::place.wrap_bottom));
}

/// Two channels that start each other: there is no moment without one.
void EdgePort::set_up_ring() {
    for (unsigned i = 2; i-- > 0;) {  // the one that is started is the first
        DmaChannel& channel = dma().channels[ring_channels[i]];
        channel.read_address = reinterpret_cast<std::uintptr_t>(&pio(0).receive[watcher::machine]);
        channel.write_address = reinterpret_cast<std::uintptr_t>(words);
        channel.count = run;
        const std::uint32_t control = dma_enable | dma_words | dma_increment_write |
                                      dma_ring_on_write | dma_ring_bits(ring_bits) |
                                      dma_chain_to(ring_channels[1 - i]) |
                                      dma_paced_by(request_pio0_receive0 + watcher::machine);
        if (i == 0)
            channel.control_trigger = control;
        else
            channel.alias1_control = control;
    }
    dma().interrupt0_enable = 1U << dma_edges0 | 1U << dma_edges1;
    set_bits(pio(0).interrupt0_enable, 1U << (8U + watcher::flag));
}

void EdgePort::count_run() {
    dma().interrupt0_status = 1U << ring_channels[runs_ % 2];
    runs_ = runs_ + 1;
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

/// Until what the watcher has seen by now is in it.
void EdgePort::wait_for_ring() const {
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
    wait_for_ring();
    const std::uint32_t until = written();
    quiet_ |= pins;
    for (unsigned i = 0; i < watched_inputs; ++i)
        if ((pins >> i & 1U) != 0) quiet_until_[i] = until;
}

/// Pins that are quiet in the word of this index, which is the next to be read.
std::uint32_t EdgePort::quiet(std::uint32_t index) {
    for (unsigned i = 0; i < watched_inputs; ++i)
        if ((quiet_ >> i & 1U) != 0 && static_cast<std::int32_t>(index - quiet_until_[i]) >= 0)
            quiet_ &= ~(1U << i);
    return quiet_;
}

/// Looks at what is new: does it need attention, and did a data-ready input rise?
void EdgePort::scan() {
    const std::uint32_t end = written();
    const std::uint32_t now = clock_.low_ns();
    const bool too_late = now - scanned_low_ns_ > SampleClock::oldest;
    scanned_low_ns_ = now;
    if (loop_.awaited && end == scanned_ && since(loop_.at_low_ns, now) > loop_patience)
        judge_loop(false);
    if (end == scanned_) return samples_.pass(now);
    if (watcher_.overflowed()) restart_at_once();  // the times of all words after are unknown
    if (too_late || end - read_ > capacity) return drop_all();
    for (; scanned_ != end; ++scanned_) scan_word(words[scanned_ % capacity], now);
    if (overwritten(read_)) return drop_all();
    if (end - read_ > capacity / 2) attention_ = true;
}

void EdgePort::scan_word(std::uint32_t word, std::uint32_t now_low_ns) {
    samples_.next(word >> watched_pins, now_low_ns);
    low_ns_[scanned_ % capacity] = samples_.edge();
    const std::uint32_t all_changed = word ^ scanned_state_;
    const std::uint32_t changed = all_changed & listened_;
    scanned_state_ = word;
    if ((changed & ~ready_pins) != 0) attention_ = true;
    if ((all_changed & loop_bit) != 0) loop_came_back();
    std::uint32_t rises = changed & word & ready_pins & ~quiet_;
    for (unsigned i = 0; rises != 0; rises >>= 1U, ++i)
        if ((rises & 1U) != 0) rise_[i] = BoardClock::from_low_ns(samples_.edge(), clock_.now());
}

void EdgePort::loop_came_back() {
    if (!loop_.awaited) return;  // dropped, with what was before it
    const std::int32_t off = since(loop_.at_low_ns, samples_.edge());
    judge_loop(off >= -loop_tolerance && off <= loop_tolerance);
}

/// Without the proof that stamps are right, there are none.
void EdgePort::judge_loop(bool as_expected) {
    loop_.awaited = false;
    loops_good_ = as_expected ? loops_good_ + 1 : 0;
    const bool proved = loops_good_ >= loops_to_trust;
    if (loop_.proved && !proved) {
        ++lost_;
        attention_ = true;
    }
    loop_.proved = proved;
    if (proved) stamp_test_ = wire::StampTest::passed;
    if (!as_expected) stamp_test_ = wire::StampTest::failed;
}

/// Which edges there were is no longer known.
void EdgePort::drop_all() {
    wait_for_ring();
    const std::uint32_t end = written();
    lost_ += end - read_;
    samples_.skip(end - scanned_);
    read_ = scanned_ = end;
    state_ = scanned_state_ = words[(end - 1) % capacity];
    changes_ = 0;
    attention_ = true;
    loop_.awaited = false;  // it may be among them
}

void EdgePort::take_change() {
    const std::uint32_t word = words[read_ % capacity];
    if (overwritten(read_)) return drop_all();
    std::uint32_t changed = (word ^ state_) & listened_ & (word | ~ready_pins);
    if (quiet_ != 0) changed &= ~quiet(read_);
    if (!loop_.proved && changed != 0) {
        ++lost_;
        changed = 0;
    }
    state_ = word;
    changes_ = changed;
    // The core is polled once a second at least, so what is settled is never long ago.
    if (changed != 0) changed_at_ = BoardClock::from_low_ns(low_ns_[read_ % capacity], settled_);
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
    if (lost_ != 0) return false;  // before this one
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
