// SPDX-License-Identifier: BSD-3-Clause
#include "routing_port.hpp"

namespace versavis::rp2040 {

namespace {

using firmware::camera_count;
using firmware::not_routed;
using firmware::Routes;

bool same_light(const Routes& a, const Routes& b) {
    return a.light_cameras == b.light_cameras && a.light_inverted == b.light_inverted &&
           a.light_limit == b.light_limit;
}

bool same_trigger(const Routes& a, const Routes& b, unsigned camera) {
    return a.master[camera] == b.master[camera] &&
           ((a.inverted_triggers ^ b.inverted_triggers) >> camera & 1U) == 0;
}

}  // namespace

void RoutingPort::set_up() {
    slaves_[0].load(copier::slave_code, copier::slave_place[0]);
    copier_.load(copier::code, copier::place);
}

RoutingPort::Switched RoutingPort::route(const Routes& routes, bool force) {
    edges_.invert(routes.inverted_exposures);
    if (!driven_) begin_to_drive(routes);
    const std::uint32_t masters = changed_masters(routes);
    for (unsigned i = 0; i < camera_count; ++i)
        if (routes_.master[i] == not_routed && routes.master[i] != not_routed)
            copy_master(i, routes);
    unsigned changed = 0;
    for (unsigned i = 0; i < camera_count; ++i)
        if (!same_trigger(routes, routes_, i)) changed |= 1U << i;
    Switched switched;
    {
        const InterruptsOff undisturbed;
        switched.clean = !masters_expose(masters);
        if (switched.clean || force) {
            for (unsigned i = 0; changed >> i != 0; ++i)
                if ((changed >> i & 1U) != 0) switch_trigger(i, routes);
            switched.at = clock_.now();
            if (masters_expose(masters)) switched.clean = false;
        }
    }
    if (switched.at == firmware::never) return {};
    if (!same_light(routes, routes_)) configure_light(routes);
    if (routes.test_input != routes_.test_input) copy_input(routes.test_input);
    routes_ = routes;
    return switched;
}

/// Its machine does, whether the pin shows it yet or not.
void RoutingPort::copy_master(unsigned camera, const Routes& routes) {
    const bool inverted = (routes.inverted_triggers >> camera & 1U) != 0;
    MachinePins pins;
    pins.in = pin_exposure0 + routes.master[camera];
    pins.out = pin_trigger0 + camera;
    pins.out_count = 1;
    StateMachine& machine = slaves_[camera];
    const Place& place = copier::slave_place[inverted ? 1 : 0];
    machine.stop();
    machine.set_up(place, pins, {});
    machine.make_outputs(pins.out, 1, inverted);
    machine.execute(pio_assembly::jump(place.first));
    machine.run();
}

void RoutingPort::switch_trigger(unsigned camera, const Routes& routes) {
    const unsigned pin = pin_trigger0 + camera;
    if (routes.master[camera] == not_routed) {
        set_function(pin, function_pio0);
        slaves_[camera].stop();
        return;
    }
    if (routes_.master[camera] != not_routed) copy_master(camera, routes);
    set_function(pin, function_pio1);
}

/// From high impedance to the levels at rest.
void RoutingPort::begin_to_drive(const Routes& routes) {
    const Nanoseconds at = outputs_.rest(routes.inverted_triggers);
    while (clock_.now() <= at) {
    }
    for (unsigned pin = pin_trigger0; pin < pin_trigger0 + camera_count; ++pin)
        set_function(pin, function_pio0);
    set_function(pin_sync_output, function_pio0);
    set_function(pin_test_output, function_pio0);
    configure_light(routes);
    driven_ = true;
}

/// The masters of slaves whose route changes, now or before.
std::uint32_t RoutingPort::changed_masters(const Routes& routes) const {
    std::uint32_t masters = 0;
    for (unsigned i = 0; i < camera_count; ++i) {
        if (routes.master[i] == routes_.master[i]) continue;
        if (routes.master[i] != not_routed) masters |= 1U << routes.master[i];
        if (routes_.master[i] != not_routed) masters |= 1U << routes_.master[i];
    }
    return masters;
}

bool RoutingPort::masters_expose(std::uint32_t masters) const {
    for (unsigned i = 0; i < camera_count; ++i)
        if ((masters >> i & 1U) != 0 && (io_bank().gpio[pin_exposure0 + i].status & gpio_seen) != 0)
            return true;
    return false;
}

void RoutingPort::configure_light(const Routes& routes) {
    light_.configure(routes.light_cameras, routes.light_inverted, routes.light_limit);
}

void RoutingPort::copy_input(std::uint8_t input) {
    copier_.stop();
    if (input == not_routed) return;
    MachinePins pins;
    pins.in = pin_of_input(input);
    pins.out = pin_test_output;
    pins.out_count = 1;
    copier_.set_up(copier::place, pins, {});
    copier_.execute(pio_assembly::jump(copier::place.first));
    copier_.run();
}

}  // namespace versavis::rp2040
