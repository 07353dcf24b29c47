// SPDX-License-Identifier: BSD-3-Clause
// USB of the machine, with a tiny device that sends back what it gets: setting it up, bytes both
// ways, a host that does not read, resets, suspension; the controller's erratum; and that what the
// host leaves out changes nothing.
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

import { check, check_fault, check_within, finish } from './check.mjs';
import { Machine } from './machine.mjs';
import { compile, pio as code } from './program.mjs';
import { peek, poke, release, start_clocks } from './setup.mjs';

const ms = 125_000;
const source = join(dirname(fileURLToPath(import.meta.url)), 'usb_echo.c');
const program = compile(source);
const usb_times = { debounce_ms: 1, reset_ms: 2, recovery_ms: 1 };

function start(options = {}) {
    const machine = new Machine({ usb_times, ...options });
    start_clocks(machine);
    release(machine, 'io_bank0', 'pads_bank0', 'usb', 'pio0', 'dma');
    machine.watch([25]);
    machine.got = [];
    machine.usb.on_bytes = (bytes, cycle) => machine.got.push({ bytes: [...bytes], cycle });
    machine.start_in_ram(program);
    return machine;
}

function configured(options) {
    const machine = start(options);
    machine.run_for(12 * ms);
    check('it is configured', machine.usb.state, 'configured');
    return machine;
}

const received = (machine) => machine.got.flatMap(({ bytes }) => bytes);

function setting_up() {
    const machine = start();
    let at = 0;
    machine.usb.on_configured = () => (at = machine.now);
    const begin = machine.now;
    machine.run_for(3 * ms);
    check('during the reset', [machine.usb.state, machine.usb_device.address], ['attached', 0]);
    machine.run_for(12 * ms);
    check_within('ms until it is configured', (at - begin) / ms, 4, 10);
    check('its texts', machine.usb.descriptors.strings, ['bbc', 'cbc', 'dbc']);
    check('its numbers', machine.usb.endpoints, {
        interface_number: 0,
        notify: 1,
        bulk_out: 2,
        bulk_in: 2,
    });
    check('its address', machine.usb_device.address, 1);
    const ends = [];
    machine.usb.set_line_coding(115200, (result) => ends.push(result.length));
    machine.usb.set_line_state(true, false, (result) => ends.push(result.length));
    machine.run_for(ms);
    check('requests for the line', ends, [0, 0]);
    check_within('the timer went on', machine.log.length, 15, 16);
}

function echoes() {
    const machine = configured();
    const bytes = Array.from({ length: 150 }, (_, i) => i);
    const begin = machine.now;
    machine.usb.write(bytes, begin + 1000);
    machine.run_for(3 * ms);
    check(
        'what comes back',
        received(machine),
        bytes.map((byte) => byte + 1),
    );
    check(
        'in packets',
        machine.got.map(({ bytes: { length } }) => length),
        [64, 64, 22],
    );
    // A packet of 64 bytes takes 47 us, and goes twice.
    check_within('us of the first', (machine.got[0].cycle - begin) / 125, 95, 250);
    machine.got.length = 0;
    machine.usb.write(new Array(64).fill(7));
    machine.run_for(ms);
    check(
        'an empty packet ends a full one',
        machine.got.map(({ bytes: b }) => b.length),
        [64, 0],
    );
}

function back_pressure() {
    const machine = configured();
    machine.usb.set_reading(false);
    const written = [];
    machine.usb.on_written = (bytes) => written.push(bytes.length);
    machine.usb.write(new Array(200).fill(1));
    machine.run_for(5 * ms);
    check('nothing is read', machine.got.length, 0);
    check('the device takes no more', written, [64]);
    machine.usb.set_reading(true);
    machine.run_for(5 * ms);
    check('then all comes', received(machine).length, 200);
}

function plugging() {
    const machine = configured();
    const sof = () => peek(machine, 0x50110048);
    const first = sof();
    machine.run_for(7 * ms);
    check('frames are counted', sof() - first, 7);
    machine.usb.suspend();
    machine.run_for(10 * ms);
    check('suspended', [peek(machine, 0x50110050) & 0x10, machine.usb.state], [0x10, 'suspended']);
    machine.usb.resume();
    machine.run_for(30 * ms);
    check('resumed', [peek(machine, 0x50110050) & 0x10, machine.usb.state], [0, 'configured']);
    machine.usb.write([5]);
    machine.run_for(2 * ms);
    check('it still echoes', received(machine), [6]);
    machine.usb.disconnect();
    machine.run_for(5 * ms);
    check('unplugged', machine.usb.state, 'detached');
    machine.usb.connect();
    machine.run_for(12 * ms);
    machine.usb.write([8]);
    machine.run_for(2 * ms);
    check('plugged in again', received(machine), [6, 9]);
}

function erratum() {
    const at = 0x50100090;
    const word = 0x8001;
    const available = 0x400;
    const arm =
        (wait, together = false) =>
        () => {
            const machine = configured();
            if (!together) poke(machine, at, word);
            machine.clock.now += wait;
            poke(machine, at, word | available);
            return machine;
        };
    check_fault('AVAILABLE together with the rest', 'together with', arm(20, true));
    check_fault('11 cycles after it', '11 cycles after the rest', arm(11));
    check('12 cycles after it', arm(12)().stopped, undefined);
    const made = new Machine();
    start_clocks(made);
    poke(made, 0x40008054, 0);
    release(made, 'usb');
    check_fault('without its clock', 'clk_usb', () => poke(made, 0x50110040, 1));
}

/// Only a reset of the controller ends a hang; a host that resets the bus does not.
function hangs() {
    const counts = (machine) => {
        const first = peek(machine, 0x50110048);
        machine.run_for(5 * ms);
        return peek(machine, 0x50110048) - first;
    };
    for (const [kind, frames, errors] of [
        ['deaf', 0, 0],
        ['failed', 5, 1],
        ['mute', 5, 0],
    ]) {
        const machine = configured();
        machine.usb.write([5], machine.now + ms);
        machine.usb_device.hang(kind);
        check(`${kind}: frames`, counts(machine), frames);
        check(`${kind}: errors`, (peek(machine, 0x50110050) >>> 24) & 1, errors);
        check(`${kind}: what the host sees`, machine.usb.error, 'bulk OUT: silence');
        machine.usb.reset();
        machine.run_for(12 * ms);
        check(`${kind}: after a reset`, machine.usb.state, 'attached');
        poke(machine, 0x4000e000, 1 << 24);
        check(`${kind}: without the controller`, machine.usb.state, 'detached');
        check(`${kind}: after it was reset`, machine.usb_device.answers_nothing, false);
    }
    const machine = start();
    machine.usb.busy_resets = 1;
    machine.run_for(12 * ms);
    check('a busy bus after the reset', [machine.usb.state, counts(machine)], ['attached', 0]);
    machine.usb.reset();
    machine.run_for(12 * ms);
    check('one that rests', machine.usb.state, 'configured');
    const corrupted = configured();
    corrupted.usb.corrupts = 'deaf';
    for (let i = 0; i < 40; ++i) corrupted.usb.write([i], corrupted.now + 0.53 * ms * i);
    corrupted.run_for(25 * ms);
    check('a packet that ends late in a frame', corrupted.usb.error, 'bulk IN: silence');
}

function everything_at_once(naive) {
    const machine = configured({ naive });
    const pio0 = 0x50200000;
    // Stamps both edges of GPIO 9, and follows GPIO 9 by GPIO 3.
    const stamps = [
        code.jmp('x--', 1),
        code.jmp('pin', 0),
        code.mov('isr', 'x', 1),
        code.push({ block: false }),
        code.jmp('x--', 5),
        code.jmp('pin', 0),
        code.jmp('', 4),
    ];
    const follows = [
        code.wait(1, 'gpio', 9),
        code.set('pins', 1),
        code.wait(0, 'gpio', 9),
        code.set('pins', 0),
    ];
    [...stamps, ...follows].forEach((opcode, i) => poke(machine, pio0 + 0x48 + 4 * i, opcode));
    poke(machine, pio0 + 0xcc, (9 << 24) | (6 << 12));
    poke(machine, pio0 + 0xe4, (10 << 12) | (7 << 7));
    poke(machine, pio0 + 0xf4, (1 << 26) | (3 << 5));
    poke(machine, pio0 + 0xf0, code.set('pindirs', 1));
    poke(machine, pio0 + 0xf0, 7);
    poke(machine, 0x4001401c, 6);
    machine.watch([3]);
    poke(machine, 0x50000000, pio0 + 0x20);
    poke(machine, 0x50000004, 0x20010000);
    poke(machine, 0x50000008, 1000);
    poke(machine, 0x5000000c, 1 | (2 << 2) | (1 << 5) | (4 << 15));
    poke(machine, pio0, 3);
    const begin = machine.now;
    for (let i = 0; i < 200; ++i) machine.set_input(9, i & 1, begin + 4999 * i);
    for (let i = 0; i < 9; ++i) machine.usb.write(new Array(30 * i).fill(i), begin + 77_777 * i);
    machine.run_for(10 * ms);
    const words = Array.from({ length: 101 }, (_, i) => peek(machine, 0x20010000 + 4 * i));
    return {
        words,
        log: machine.log,
        got: machine.got,
        sleep: machine.sleep_cycles,
        left: peek(machine, 0x50000008),
    };
}

function leaving_out() {
    const fast = everything_at_once(false);
    const naive = everything_at_once(true);
    check('enough stamps', 1000 - fast.left, 100);
    // High, it counts each 2 cycles, and low, each 3.
    check_within('their distance', fast.words[50] - fast.words[49], 4164, 4168);
    check('enough bytes', fast.got.flatMap(({ bytes }) => bytes).length, 30 * 36);
    for (const name of Object.keys(fast))
        check(`leaving out what has no effect: ${name}`, fast[name], naive[name]);
}

setting_up();
echoes();
back_pressure();
plugging();
erratum();
hangs();
leaving_out();
finish('USB of the machine');
