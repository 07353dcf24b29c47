// SPDX-License-Identifier: BSD-3-Clause
#include "light_port.hpp"

namespace versavis::rp2040 {

namespace {

/// The last command takes effect within that time.
constexpr std::uint32_t shown_after_us = 450;

/// Light that is still wanted during a new configuration ends by itself within that time. If lower,
/// light that is about to end is cut; if higher, a configuration takes 1 ms more.
constexpr std::uint32_t patience_us = 1'000;

/// From the look at the cycle counter to when a machine that slept shows its next state but one.
constexpr std::int32_t wake_cycles = 35;

}  // namespace

void LightPort::set_up() {
    MachinePins pins;
    pins.in = pin_exposure0;
    pins.side = pin_light;
    pins.side_count = 2;
    pins.side_optional = true;
    Shifting shifting;
    shifting.join_transmit = true;
    machine_.load(light::code, light::place);
    machine_.load(light::asleep_code, {light::asleep, 0, 0});
    machine_.set_up(light::place, pins, shifting);
    machine_.make_outputs(pin_light, 1);
    machine_.execute(pio_assembly::jump(light::asleep));
}

void LightPort::configure(std::uint32_t cameras, bool inverted, Nanoseconds limit) {
    const std::uint32_t begun_us = timer().low;
    for (bool done = false; !done;) {
        const InterruptsOff undisturbed;
        const std::uint32_t now_us = timer().low;
        done = state_ == State::asleep && now_us - dark_from_us_ > shown_after_us;
        if (done) {
            const Nanoseconds cycles = limit / cycle_ns;
            limit_ = cycles < INT32_MAX ? static_cast<std::int32_t>(cycles) : INT32_MAX;
            has_cameras_ = cameras != 0;
            if (has_cameras_) load(light::following(cameras));
        } else if (now_us - begun_us > patience_us) {
            left_ = 0;
        }
    }
    set_function(pin_light, function_pio0, override_none,
                 inverted ? override_invert : override_none);
}

void LightPort::load(const light::Following& following) {
    machine_.load(following.code, {light::follow, 0, 0});
    round_cycles_ = following.round_cycles;
}

/// The state lasts that much longer.
void LightPort::last(std::int32_t cycles) {
    behind_ += cycles;
    left_ -= cycles;
    if (left_ > 0) return;
    behind_ += left_;  // which is where it ends
    left_ = 0;
    send();
    enter(State::asleep);
}

void LightPort::become(std::uint32_t cycle, State wanted) {
    if (wanted_ == State::asleep) left_ = limit_;
    wanted_ = wanted;
    if (left_ == 0 || (wanted == State::follows && !has_cameras_)) wanted = State::asleep;
    if (wanted == state_) return;
    if (state_ == State::asleep)
        wait_until(cycle);
    else
        send();
    enter(wanted);
}

void LightPort::enter(State state) {
    state_ = state;
    if (state != State::asleep) return;
    machine_.send(light::asleep << light::round_bits);
    behind_ = 0;
    dark_from_us_ = timer().low;
}

void LightPort::wait_until(std::uint32_t cycle) {
    const InterruptsOff undisturbed;
    const std::int32_t cycles = clock_.cycles_until(cycle) - wake_cycles;
    machine_.send(static_cast<std::uint32_t>(cycles > 0 ? cycles : 0) | light::waiting
                                                                            << light::round_bits);
    behind_ = 0;
}

/// The state is what it was for all of the time that has passed, to within a round.
void LightPort::send() {
    const bool follows = state_ == State::follows;
    const std::uint32_t round_cycles = follows ? round_cycles_ : 1;
    constexpr std::uint32_t other_cycles = light::fetch_cycles + 1;  // with the jump back
    const std::int32_t left = behind_ - static_cast<std::int32_t>(other_cycles);
    std::uint32_t rounds = left > 0 ? static_cast<std::uint32_t>(left) / round_cycles : 0;
    if (rounds == 0) rounds = 1;
    machine_.send((rounds - 1) | (follows ? light::follow : light::lit) << light::round_bits);
    behind_ -= static_cast<std::int32_t>(other_cycles + rounds * round_cycles);
}

}  // namespace versavis::rp2040
