// SPDX-License-Identifier: BSD-3-Clause
// What lies between a pin and whoever drives it: delays, capacitors, contacts, clamps, and the
// moment at which the clock takes a level in.
import { check, check_within, finish } from './check.mjs';
import { Clock } from './clock.mjs';
import { Pins, pin_function } from './pins.mjs';

const gpio = 3;
const bit = 1 << gpio;

/// Changes of an input behind a path with these properties, as [cycle, level], while its driver
/// changes it at these instants, up first.
function passed(properties, instants, path_of = () => {}) {
    const clock = new Clock();
    const pins = new Pins(clock, { set_line() {} });
    const seen = [];
    pins.listeners.push((changed, time) => {
        if (changed & bit) seen.push([time, (pins.inputs >>> gpio) & 1]);
    });
    path_of(pins.set_path(gpio, properties), pins, clock);
    pins.set_external(gpio, 0);
    instants.forEach((at, i) =>
        clock.input_at(Math.floor(at), () => pins.set_external(gpio, 1 - (i % 2), at)),
    );
    clock.settle(1e6);
    return seen;
}

const pulses = (count, period, width) =>
    Array.from({ length: 2 * count }, (_, i) => 100 + (i >> 1) * period + (i % 2) * width);

function edges_are_delayed() {
    const both = { rise_ns: 10, fall_ns: 20 };
    check('edges', passed(both, [100, 200]), [[101, 1], [202, 0]]);
    check('between cycles', passed({}, [100.25, 200.75]), [[100, 1], [200, 0]]);
    check('within one', passed(both, [100.25, 200.75]), [[101, 1], [203, 0]]);
    // A pulse gets longer or shorter by the difference, and nothing is left of one that is short.
    check('too short', passed({ rise_ns: 20, fall_ns: 4 }, [100, 102]), []);
    const slow = { rise_ns: 20, fall_ns: 4 };
    check('just long enough', passed(slow, [100, 103]), [[102, 1], [103, 0]]);
}

function a_capacitor_passes_what_lasts() {
    const load = { shortest_ns: 80 };
    check('short', passed(load, [100, 109, 130, 139]), []);
    check('long', passed(load, [100, 110]), [[110, 1], [120, 0]]);
    check('a gap', passed(load, [100, 200, 205, 300]), [[110, 1], [310, 0]]);
}

function pulses_get_lost() {
    const all = passed({}, pulses(1000, 50, 20));
    const some = passed({ loses: 0.25, seed: 7 }, pulses(1000, 50, 20));
    check('all', all.length, 2000);
    check_within('some', some.length, 1400, 1600);
    check('whole ones', some.every(([, level], i) => level === 1 - (i % 2)), true);
    const widths = some.filter((_, i) => i % 2).map(([at], i) => at - some[2 * i][0]);
    check('of their width', widths.every((width) => width === 20), true);
    check('once more', passed({ loses: 0.25, seed: 7 }, pulses(1000, 50, 20)), some);
    const others = passed({ loses: 0.25, seed: 8 }, pulses(1000, 50, 20));
    check('others', JSON.stringify(others) === JSON.stringify(some), false);
}

function contacts_bounce() {
    const seen = passed({ bounces: 3, bounce_ns: 800, seed: 5 }, pulses(500, 1000, 400));
    check('alternates', seen.every(([, level], i) => level === 1 - (i % 2)), true);
    check_within('changes', seen.length, 3000, 5000); // four on average
    for (const [at] of seen) check_within('near its edge', (at - 100) % 400, 0, 300);
    const first = new Set(seen.map(([at]) => at));
    check('begins with its edge', pulses(500, 1000, 400).every((at) => first.has(at)), true);
    // The next edge ends it.
    const ended = passed({ bounces: 3, bounce_ns: 4000, seed: 5 }, pulses(500, 1000, 20));
    for (const [at] of ended) check_within('at most as long', (at - 100) % 1000, 0, 520);
    check('is low in the end', ended.at(-1)[1], 0);
}

function a_clamp_holds() {
    check('high', passed({ clamp: 1 }, [100, 200]).length, 1); // the clamp itself
    check('low', passed({ clamp: 0 }, [100, 200]), []);
    const released = (_, pins, clock) => clock.input_at(150, () => pins.set_path(gpio));
    check('released', passed({ clamp: 0 }, [100, 200], released), [[150, 1], [200, 0]]);
}

function the_clock_takes_in() {
    const near = (part) => pulses(1000, 50, 20).map((at) => at + part);
    const late = (part, jitter_ns) => {
        const delay = 4; // so that what comes just after the clock's edge is on its way before it
        const path = { rise_ns: delay, fall_ns: delay, jitter_ns, seed: 3 };
        const at_pin = passed(path, near(part - delay / 8));
        return at_pin.map(([at], i) => at - near(0)[i]);
    };
    for (const part of [0.9, 1, 1.1]) {
        const cycles = late(part, 2); // 1 ns before the edge of the clock, and 1 ns after it
        check_within(`early at ${part}`, cycles.filter((n) => n === 0).length, 900, 1100);
        check_within(`late at ${part}`, cycles.filter((n) => n === 1).length, 900, 1100);
    }
    check('far from it', late(0.5, 2).every((n) => n === 0), true);
    check('without', late(0.9, 0).every((n) => n === 0), true);
}

function outputs_have_paths() {
    const clock = new Clock();
    const pins = new Pins(clock, { set_line() {} });
    const driver = { out: 0, enable: bit };
    pins.add_source(pin_function.sio, driver);
    pins.write_control(gpio, pin_function.sio);
    const path = pins.set_path(gpio, { rise_ns: 12, fall_ns: 3 });
    pins.watched = bit;
    for (const [cycle, level] of [[10, bit], [20, 0]])
        clock.at(cycle, () => {
            driver.out = level;
            pins.drive();
        });
    clock.settle(100);
    check('log', pins.log.map(({ cycle, levels }) => [cycle, levels]), [[11, bit], [20, 0]]);
    check('edges', path.edges, [{ at: 12.5, level: 1 }, { at: 21.375, level: 0 }]);
    pins.set_path(gpio);
    clock.at(110, () => {
        driver.out = bit;
        pins.drive();
    });
    clock.settle(200);
    check('ideal', pins.log.at(-1).cycle, 110);
}

function the_capacitor_of_a_pico() {
    const pins = new Pins(new Clock(), { set_line() {} });
    check('GPIO29', [...pins.paths].map(([number, { shortest_ns }]) => [number, shortest_ns]), [
        [29, 100_000],
    ]);
}

edges_are_delayed();
a_capacitor_passes_what_lasts();
pulses_get_lost();
contacts_bounce();
a_clamp_holds();
the_clock_takes_in();
outputs_have_paths();
the_capacitor_of_a_pico();
finish('pads of the machine');
