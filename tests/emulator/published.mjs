// SPDX-License-Identifier: BSD-3-Clause
// The image on rp2040js as published: its processor, registers, state machines and USB host, none of
// which is ours. It has no time for state machines (they take a cycle for what takes more) and runs
// them beside the processor, so they are stepped here, and what they stamp is not looked at.
//
// published.mjs IMAGE.uf2
import { readFileSync } from 'node:fs';
import process from 'node:process';
import { Simulator, USBCDC } from 'rp2040js';

import { check, check_within, finish } from './check.mjs';
import { Host } from './protocol.mjs';
import { read_uf2 } from './uf2.mjs';

const flash_begin = 0x10000000;
const ram_end = 0x20042000;
const cycle_ns = 8;
const longest_nap_ns = 1000; // for state machines to go on meanwhile
const us = 1000;
const ms = 1_000_000;

class Pico {
    constructor(image) {
        ({ clock: this.clock, rp2040: this.chip } = new Simulator());
        this.chip.logger = { debug() {}, info() {}, warn() {}, error: (part, words) => {
            throw new Error(`${part}: ${words}`);
        } };
        for (const { address, bytes } of read_uf2(image))
            this.chip.flash.set(bytes, address - flash_begin);
        // It has no boot ROM: as that does, it runs what the flash begins with.
        this.chip.core.PC = flash_begin;
        this.chip.core.SP = ram_end;
        this.serial = new USBCDC(this.chip.usbCtrl);
    }

    run_until(done, limit_ns) {
        const { chip, clock } = this;
        const end = clock.nanos + limit_ns;
        while (!done() && clock.nanos < end) {
            const nap = Math.min(clock.nanosToNextAlarm || longest_nap_ns, longest_nap_ns);
            const cycles = chip.core.waiting
                ? Math.max(1, Math.floor(nap / cycle_ns))
                : chip.core.executeInstruction();
            for (const block of chip.pio)
                for (let i = 0; i < cycles && !block.stopped; ++i) block.step();
            clock.tick(cycles * cycle_ns);
        }
        return done();
    }
}

const pico = new Pico(readFileSync(process.argv[2]));
const host = new Host((bytes) => bytes.forEach((byte) => pico.serial.sendSerialByte(byte)));
const answers = (kind, count = 1) => () => host.all(kind).length >= count;
let connected = false;
pico.serial.onDeviceConnected = () => (connected = true);
pico.serial.onSerialData = (bytes) => host.receive(bytes);

check('its USB host sets the board up', pico.run_until(() => connected, 100 * ms), true);
check('endpoints of the data', [pico.serial.inEndpoint, pico.serial.outEndpoint], [1, 1]);

host.hello();
check('hello is answered', pico.run_until(answers('hello'), 100 * ms), true);
const { major, cameras, firmware } = host.last('hello') ?? {};
check('protocol, cameras', [major, cameras], [3, 4]);
check('name', /^versavis \d+\.\d+/.test(firmware), true);

const asked = [];
for (let id = 1; id <= 5; ++id) {
    asked.push(pico.clock.nanos);
    host.ask_time(id);
    check(`time is reported, ${id}`, pico.run_until(answers('clock', id), 10 * ms), true);
    pico.run_until(() => false, 3 * ms);
}
const times = host.all('clock');
times.forEach(({ received, sent }, i) => {
    check_within('from received to sent', sent - received, 0, 200 * us);
    const passed = received - times[0].received;
    check_within('time that passes', passed - (asked[i] - asked[0]), -100 * us, 100 * us);
});

host.configure({ cameras: [{}] });
check('a configuration is answered', pico.run_until(answers('answer'), 100 * ms), true);
check('and taken', [host.last('answer')?.status, host.last('answer')?.refusals], [0, 0]);
check('packets that do not read, or are missing', [host.bad, host.gaps], [0, 0]);
for (const block of pico.chip.pio) block.stop(); // they would run on beside, for ever
finish('rp2040js as published');
