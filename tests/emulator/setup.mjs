// SPDX-License-Identifier: BSD-3-Clause
// Sets a machine up by its registers, for tests whose program does not.
import { reset_bit } from './clock_tree.mjs';
import { pin_function } from './pins.mjs';

const settle_cycles = 300_000; // crystal and PLLs

export const peek = (machine, address) => machine.bus.read32(address);
export const poke = (machine, address, value) => machine.bus.write32(address, value);

export function release(machine, ...names) {
    const bits = names.reduce((word, name) => word | (1 << reset_bit[name]), 0);
    poke(machine, 0x4000f000, bits);
    machine.clock.settle(machine.now + 100);
}

function start_pll(machine, begin, feedback, dividers) {
    poke(machine, begin, 1);
    poke(machine, begin + 8, feedback);
    poke(machine, begin + 0x3004, 0x21);
    machine.clock.settle(machine.now + 10_000);
    poke(machine, begin + 0xc, dividers);
    poke(machine, begin + 0x3004, 0x08);
}

/// 125 MHz for processor and peripherals, 48 MHz for USB, 1 MHz for the timer.
export function start_clocks(machine) {
    poke(machine, 0x4002400c, 47);
    poke(machine, 0x40024000, 0xfabaa0);
    machine.clock.settle(machine.now + settle_cycles);
    poke(machine, 0x40008030, 2);
    release(machine, 'pll_sys', 'pll_usb', 'timer');
    start_pll(machine, 0x40028000, 125, (6 << 16) | (2 << 12));
    start_pll(machine, 0x4002c000, 100, (5 << 16) | (5 << 12));
    poke(machine, 0x4000803c, 0);
    poke(machine, 0x4000803c, 1);
    poke(machine, 0x40008048, 1 << 11);
    poke(machine, 0x40008054, 1 << 11);
    poke(machine, 0x4005802c, 0x200 | 12);
}

/// Gives GPIO to a function (`pin_function` of pins.mjs).
export function give_pins(machine, number, ...gpios) {
    for (const gpio of gpios) poke(machine, 0x40014004 + 8 * gpio, number);
}

/// GPIO `gpio` by SIO, as output.
export function sio_output(machine, gpio) {
    give_pins(machine, pin_function.sio, gpio);
    poke(machine, 0xd0000024, 1 << gpio);
}
