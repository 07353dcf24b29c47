// SPDX-License-Identifier: BSD-3-Clause
// The levels that a LiDAR sees at the emulated chip: pulses at the test output, and the bits of the
// sentences at the UART's transmitter; in the lines of tests/lidar/trace.cpp, and `bit AT 0|1` for
// the serial line.
//
// usage: lidar_trace.mjs IMAGE.uf2 SECONDS FIRST_UTC_S PULSE_NS BAUD SENTENCES FLAGS
import { Rig, cycle_ns, pin, quick_usb } from './rig.mjs';

const [image, ...numbers] = process.argv.slice(2);
const [seconds, first_utc_s, pulse, baud, sentences, flags] = numbers.map(Number);
const gpio_transmit = 0;
const time_known = 1;

const rig = new Rig(image, quick_usb);
rig.machine.watch([gpio_transmit]);
const lines = [];
const show = (word, cycle, ...rest) =>
    lines.push([word, Math.round(cycle * cycle_ns), ...rest].join(' '));
rig.on_pin(pin.test, (cycle, level) => show('level', cycle, level ? 1 : 0));
rig.on_pin(gpio_transmit, (cycle, level) => show('bit', cycle, level ? 1 : 0));

// The board's clock, by an edge of which both times are known.
rig.machine.set_input(pin.pps, 0, 0);
rig.connect();
rig.configure({ ports: { inputs: 1 } });
const edge = rig.machine.now + 125_000;
rig.machine.set_input(pin.pps, 1, edge);
rig.run_until('the edge', () => rig.host.has_event(5));
const stamped = rig.host.all('event').find(({ event }) => event === 5).time;
const board_ns = (cycle) => Math.round((cycle - edge) * cycle_ns) + stamped;

// UTC begins at cycle 0, in the middle of a second.
const begins = first_utc_s + 0.437;
lines.unshift(`clock 0 ${BigInt(Math.round(begins * 1000)) * 1_000_000n}`);
const cycles_a_second = 1e9 / cycle_ns;
for (let i = 0; i < seconds; ++i) {
    const utc_s = Math.floor(begins + rig.machine.now / cycles_a_second) + 1;
    const known = i !== seconds >> 1; // once it is not
    rig.host.time_output({
        board: board_ns((utc_s - begins) * cycles_a_second),
        utc: utc_s,
        pulse,
        baud,
        sentences,
        flags: flags | (known ? time_known : 0),
    });
    show(known ? 'announced' : 'unknown', rig.machine.now, 0, 0);
    rig.run_ms(1000);
}
const events = rig.host.all('event').filter(({ event }) => event === 18);
for (const { time, value } of events)
    show('reported', edge + (time - stamped) / cycle_ns, value);
if (rig.host.all('log').length > 0) throw new Error(JSON.stringify(rig.host.all('log')));
process.stdout.write(`${lines.join('\n')}\n`);
