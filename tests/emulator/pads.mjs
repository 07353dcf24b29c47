// SPDX-License-Identifier: BSD-3-Clause
// The real firmware behind pads, wires and contacts that are not ideal: what it says of an edge is
// true of the edge that came through, or it says nothing.
//
// usage: pads.mjs IMAGE.uf2 IMAGE.elf [NAME...]     NAME: part of a test's name
// VERSAVIS_EDGES: so many edges of random phase, instead of 20,000
import process from 'node:process';
import { Icm42688p } from './icm42688p.mjs';
import { random_numbers } from './pin_path.mjs';
import { Rig, cycle_ns, pin, quick_usb, zero_of } from './rig.mjs';
import { check, check_within, image, run } from './suite.mjs';

const cycles_per_ms = 125_000;
const cycles_per_us = 125;
const all_outputs = [0, 1, 2, 3];

const is_measured = ({ flags }) => (flags & 1) !== 0;
const has_no_start = ({ flags }) => (flags & 2) !== 0;

/// A level that lasts so long is sampled for certain: nine cycles after a change, else six.
const surely_seen_ns = 80;

/// Pads, drivers and a clock that are as bad as stamps allow.
const bad_pad = (seed) => ({ rise_ns: 2.3, fall_ns: 6.1, jitter_ns: 2, seed });

const pulse_inputs = [
    { gpio: pin.pps, event: 5, source: 0 },
    { gpio: pin.aux0, event: 6, source: 0 },
    { gpio: pin.aux1, event: 6, source: 1 },
    { gpio: pin.sync_input, event: 7, source: 0 },
];

/// A board with four cameras; `path_of(seed)` is what lies before each input.
function rig_behind(path_of, { camera = {}, cameras, ports = { inputs: 0b1111 } } = {}) {
    const rig = new Rig(image, quick_usb);
    rig.cameras = all_outputs.map((output) => rig.add_camera(output, camera));
    rig.lines = all_outputs.map((output) =>
        rig.machine.set_path(pin.exposure + output, path_of(pin.exposure + output)),
    );
    rig.inputs = pulse_inputs.map((input) => {
        rig.machine.set_input(input.gpio, 0, 0);
        return { ...input, path: rig.machine.set_path(input.gpio, path_of(input.gpio)), edges: [] };
    });
    rig.machine.set_path(pin.loop, bad_pad(pin.loop));
    rig.connect();
    rig.configure({ cameras: cameras ?? all_outputs.map(() => ({ latency: 8000 })), ports });
    rig.host.start();
    return rig;
}
