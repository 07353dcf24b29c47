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

/// Triggers of slaves, and whether a camera of the light exposes, by the cameras that do. Others
/// are at rest: what is there is what a pin shows from when it is switched over until the router
/// runs.
std::uint32_t routed_levels(const Routes& routes, std::uint32_t exposing) {
    std::uint32_t levels = (exposing & routes.light_cameras) != 0 ? 1U << camera_count : 0;
    for (unsigned i = 0; i < camera_count; ++i) {
        const std::uint32_t active =
            routes.master[i] == not_routed ? 0 : exposing >> routes.master[i];
        levels |= ((active ^ routes.inverted_triggers >> i) & 1U) << i;
    }
    return levels;
}

}  // namespace

void RoutingPort::set_up() {
    MachinePins pins;
    pins.in = pin_exposure0;
    pins.side = pin_trigger0;
    pins.side_count = router::side_pins;
    router_.set_up(router::place, pins, {});
    router_.make_outputs(pin_trigger0, router::side_pins);

    MachinePins lamp;
    lamp.in = pin_exposing;
    lamp.side = pin_light;
    lamp.side_count = 2;
    lamp.side_optional = true;
    light_.load(light::code, light::place);
    light_.set_up(light::place, lamp, {});
    light_.make_outputs(pin_light, 1);
    light_.execute(pio_assembly::set(pio_assembly::To::y, light::table));

    copier_.load(copier::code, copier::place);
    load(program_of(routes_));
    router_.execute(pio_assembly::jump(0));
    // These come from the same clock.
    set_bits(pio(1).bypass_synchroniser, 1U << pin_exposing | 1U << pin_lead | 1U << pin_gate);
    set_function(pin_exposing, function_pio1);
    set_function(pin_lead, function_pio0);
    set_function(pin_gate, function_pio0);
    router_.run();
}

RoutingPort::Switched RoutingPort::route(const Routes& routes, bool force) {
    edges_.invert(routes.inverted_exposures);
    if (!driven_) begin_to_drive(routes);
    const Program program = program_of(routes);
    const std::uint32_t masters = changed_masters(routes);
    Switched switched;
    {
        // Until the router runs again, routed triggers stay as they are.
        const InterruptsOff undisturbed;
        router_.stop();
        switched.clean = !masters_expose(masters);
        if (switched.clean || force) {
            load(program);
            for (unsigned i = 0; i < camera_count; ++i)
                set_function(pin_trigger0 + i,
                             routes.master[i] == not_routed ? function_pio0 : function_pio1,
                             override_low);
            switched.at = clock_.now();
            if (masters_expose(masters)) switched.clean = false;
        }
        router_.run();
    }
    if (switched.at == firmware::never) return {};
    if (!same_light(routes, routes_)) load_light(routes);
    if (routes.test_input != routes_.test_input) copy_input(routes.test_input);
    routes_ = routes;
    return switched;
}

/// From high impedance to the levels at rest.
void RoutingPort::begin_to_drive(const Routes& routes) {
    const Nanoseconds at = outputs_.rest(routes.inverted_triggers);
    while (clock_.now() <= at) {
    }
    for (unsigned pin = pin_trigger0; pin < pin_trigger0 + camera_count; ++pin)
        set_function(pin, function_pio0, override_low);
    set_function(pin_sync_output, function_pio0);
    set_function(pin_test_output, function_pio0);
    load_light(routes);
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

RoutingPort::Program RoutingPort::program_of(const Routes& routes) {
    Program program{};
    for (unsigned exposing = 0; exposing < router::size; ++exposing)
        program[exposing] = router::entry(routed_levels(routes, exposing));
    return program;
}

void RoutingPort::load(const Program& program) { router_.load(program, router::place); }

void RoutingPort::load_light(const Routes& routes) {
    const auto limit =
        static_cast<std::uint64_t>(routes.light_limit) / (light::lit_cycles * cycle_ns);
    light_.stop();
    light_.send(static_cast<std::uint32_t>(limit));
    light_.execute(pio_assembly::pull());
    light_.execute(pio_assembly::optional_side(pio_assembly::jump(light::dark), false));
    light_.run();
    set_function(pin_light, function_pio1, override_none,
                 routes.light_inverted ? override_invert : override_none);
}

void RoutingPort::copy_input(std::uint8_t input) {
    copier_.stop();
    if (input != not_routed) {
        MachinePins pins;
        pins.in = pin_of_input(input);
        pins.out = pin_test_output;
        pins.out_count = 1;
        copier_.set_up(copier::place, pins, {});
        copier_.make_outputs(pin_test_output, 1);
        copier_.execute(pio_assembly::jump(copier::place.first));
        copier_.run();
    }
    set_function(pin_test_output, input == not_routed ? function_pio0 : function_pio1);
}

}  // namespace versavis::rp2040
