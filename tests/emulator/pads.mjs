// SPDX-License-Identifier: BSD-3-Clause
// The real firmware behind pads, wires and contacts that are not ideal: what it says of an edge is
// true of the edge that came through, or it says nothing.
//
// usage: pads.mjs IMAGE.uf2 IMAGE.elf [NAME...]     NAME: part of a test's name
// VERSAVIS_EDGES: so many edges of random phase, instead of 20,000, and as many more boards
import process from 'node:process';
import { Icm42688p } from './icm42688p.mjs';
import { random_numbers } from './pin_path.mjs';
import { Rig, cycle_ns, pin, quick_usb, zero_of } from './rig.mjs';
import { check, check_within, image, run } from './suite.mjs';

const cycles_per_ms = 125_000;
const cycles_per_us = 125;
const wanted_edges = Number(process.env.VERSAVIS_EDGES ?? 20_000);
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

/// A board with one camera and `path` before its loop pin; without one it is ideal.
function rig_with_loop(path) {
    const rig = new Rig(image, quick_usb);
    const camera = rig.add_camera(0);
    rig.machine.set_path(pin.loop, path);
    rig.connect();
    rig.configure({ cameras: [{ latency: 8000 }] });
    rig.host.start();
    return { rig, camera };
}

/// Errors of stamps, in buckets of 8 ns.
class Histogram {
    constructor() {
        this.buckets = new Map();
        this.count = 0;
        this.worst = 0;
    }

    add(error) {
        const bucket = Math.floor(error / 8);
        this.buckets.set(bucket, (this.buckets.get(bucket) ?? 0) + 1);
        this.worst = Math.max(this.worst, Math.abs(error));
        ++this.count;
    }

    print() {
        const sorted = [...this.buckets].sort(([a], [b]) => a - b);
        const lines = sorted.map(
            ([bucket, count]) => `    ${8 * bucket} to ${8 * bucket + 8} ns: ${count}\n`,
        );
        process.stdout.write(`    ${this.count} edges, at most ${this.worst} ns off\n`);
        process.stdout.write(lines.join(''));
    }
}

/// What came through, as [{first, edges}...] of changes for good: the instants at which its level
/// may have been seen first.
function settled_changes(path, bounce_ns) {
    const changes = [];
    path.edges.forEach(({ at, level }, i) => {
        const { edges } = path;
        const is_new = i === 0 || (at - edges[i - 1].at) * cycle_ns > bounce_ns;
        if (is_new) changes.push({ level, instants: [], is_seen: false });
        const change = changes.at(-1);
        if (change.level !== level || change.is_seen) return;
        change.instants.push(at);
        const until = edges[i + 1]?.at ?? Infinity;
        change.is_seen = (until - at) * cycle_ns >= surely_seen_ns;
    });
    return changes;
}

const nearest = (errors) =>
    errors.reduce((best, error) => (Math.abs(error) < Math.abs(best) ? error : best), Infinity);

/// Holds each exposure of `camera` against its line, of which pulses may be lost.
function check_exposures(rig, output, zero) {
    const camera = rig.cameras[output];
    const line = rig.lines[output];
    const records = rig.host.all('exposure').filter((record) => record.camera === output);
    let lost = 0;
    for (const record of records) {
        const { trigger } = record;
        const of_line = (instant, level) => line.edges
            .filter((edge) => edge.level === level)
            .map(({ at }) => at)
            .find((at) => at >= instant && at < instant + cycles_per_us);
        check(record.triggered === (camera.triggers[trigger - 1] - zero) * cycle_ns, 'trigger');
        const start = of_line(camera.starts[trigger - 1], 1);
        const end = of_line(camera.ends[trigger - 1], 0);
        if (start === undefined) {
            ++lost;
            check(has_no_start(record), `camera ${output}, trigger ${trigger}: a start is made up`);
            continue;
        }
        check(is_measured(record), `camera ${output}, trigger ${trigger}: flags ${record.flags}`);
        check_within(record.start - (start - zero) * cycle_ns, -48, 48, 'start');
        check_within(record.end - (end - zero) * cycle_ns, -48, 48, 'end');
    }
    check(records.length >= camera.triggers.length - 2, `${records.length} records`);
    return lost;
}

/// Each measured exposure is one that came through, when triggers or levels were held meanwhile:
/// most are measured, and some are not.
function check_by_time(rig, output, zero) {
    const { starts, ends } = rig.cameras[output];
    const records = rig.host.all('exposure').filter(({ camera }) => camera === output);
    const measured = records.filter(is_measured);
    check(measured.length >= 30, `${measured.length} of camera ${output} are measured`);
    check(records.length - measured.length >= 10, 'all are measured');
    for (const { start, end } of measured) {
        const error = nearest(starts.map((cycle) => start - (cycle - zero) * cycle_ns));
        const index = starts.findIndex((cycle) => start - (cycle - zero) * cycle_ns === error);
        // What the path takes is part of it.
        check_within(error, -48, 56, 'start, with its pad');
        check_within(end - (ends[index] - zero) * cycle_ns, -48, 56, 'end, with its pad');
    }
}

/// Ways in which a pin is not free, or does not work.
const bad_loops = {
    'a load of 160 ns': { shortest_ns: 160 },
    'a load of 100 us': { shortest_ns: 100_000 },
    'no pulse that comes back': { loses: 1 },
    'a low level': { clamp: 0 },
    'a high level': { clamp: 1 },
    'a rise that is late': { rise_ns: 100 },
    'a fall that is late': { fall_ns: 100 },
};

function check_loop(rig, wanted, what) {
    const { stamp_test: test } = rig.host.last('health');
    check(test === wanted, `the test of stamps says ${test} with ${what}`);
}

/// With a loop as it should be, all is measured again.
function check_free_loop(rig, camera) {
    rig.machine.set_path(pin.loop);
    rig.run_ms(1200); // for the eighth edge, and for what was exposed meanwhile
    const zero = zero_of(rig, camera);
    const { length } = rig.host.messages;
    rig.run_ms(1200);
    const { messages } = rig.host;
    const records = messages.slice(length).filter(({ kind }) => kind === 'exposure');
    check(records.length > 50, `${records.length} records`);
    for (const { trigger, start, end, flags } of records) {
        check((flags & 1) !== 0, `flags ${flags} after the loop works`);
        check_within(start - (camera.starts[trigger - 1] - zero) * cycle_ns, -48, 48, 'start');
        check_within(end - (camera.ends[trigger - 1] - zero) * cycle_ns, -48, 48, 'end');
    }
    check_loop(rig, 2, 'a free pin');
}

function send_pulses(rig, count, period, width) {
    const from = rig.machine.now + cycles_per_ms;
    const random = random_numbers(9);
    for (const input of rig.inputs)
        for (let k = 0; k < count; ++k) {
            const edge = from + k * period + random() * 1000;
            input.edges.push(edge);
            rig.machine.set_input(input.gpio, 1, edge);
            rig.machine.set_input(input.gpio, 0, edge + width + random());
        }
    rig.run_ms((count * period) / cycles_per_ms + 20);
}

const events_of = (rig, { event, source }) =>
    rig.host.all('event').filter((sent) => sent.event === event && sent.source === source);

const check_nothing_lost = (rig) => {
    rig.run_until('health', () => rig.host.last('health') !== undefined, 1100);
    const { edges_lost, stamp_test } = rig.host.last('health');
    check(edges_lost === 0 && stamp_test === 2, `${edges_lost} edges lost, test ${stamp_test}`);
    check(!rig.host.has_event(4), 'edges were lost');
    check(rig.host.bad === 0 && rig.host.gaps === 0, 'packets were lost');
};

/// Four cameras and four inputs whose edges have any phase, in groups whose edges are up to 1 us
/// apart, down to none. Both edges of exposures are stamped, the rising ones of pulses.
class AnyPhase {
    constructor() {
        this.random = random_numbers(1);
        this.histogram = new Histogram();
        const exposure = () => 2500 + this.near();
        const latency_of = () => 1000 + this.near();
        this.rig = rig_behind(bad_pad, {
            camera: { exposure, latency_of },
            cameras: all_outputs.map(() => ({ latency: 8000, rate_uhz: 500_000_000, pulse: 10_000,
                exposure: 20_000, max_exposure: 500_000 })),
        });
        this.ticks = 0;
        this.rig.on_pin(pin.trigger, (cycle, level) => level && this.tick(cycle));
    }

    /// Cycles, as often within each tenth of the one before.
    near() {
        return 125 * 10 ** (-4 * this.random());
    }

    tick(cycle) {
        const alone = 10_000 + 40_000 * this.random();
        for (const [index, from] of [1000, alone, 2 * alone].entries())
            for (const { gpio } of this.rig.inputs) {
                const is_slow = gpio === pin.pps || gpio === pin.sync_input;
                if (is_slow && index !== this.ticks % 2) continue; // not within 1 ms
                const edge = cycle + from + this.near();
                this.rig.machine.set_input(gpio, 1, edge);
                this.rig.machine.set_input(gpio, 0, edge + surely_seen_ns / cycle_ns + this.near());
            }
        ++this.ticks;
    }

    /// What has come since the last call.
    judge() {
        const { host, cameras } = this.rig;
        this.zero ??= zero_of(this.rig, cameras[0]);
        for (const message of host.messages) {
            if (message.kind === 'exposure') this.judge_exposure(message);
            if (message.kind === 'event') this.judge_event(message);
        }
        host.messages = host.messages.filter(({ kind }) => kind === 'health').slice(-1);
    }

    judge_exposure(record) {
        const { edges } = this.rig.lines[record.camera];
        check(is_measured(record), `flags ${record.flags}`);
        this.judge_stamp(record.start, edges[2 * record.trigger - 2], 'start');
        this.judge_stamp(record.end, edges[2 * record.trigger - 1], 'end');
    }

    judge_event(sent) {
        const input = this.rig.inputs.find(
            ({ event, source }) => event === sent.event && source === sent.source,
        );
        check(input !== undefined || sent.event === 15, `event ${sent.event}`); // no sync signal
        if (input === undefined) return;
        this.judge_stamp(sent.time, input.path.edges[2 * sent.value - 2], `event ${sent.event}`);
    }

    judge_stamp(stamp, { at }, what) {
        const error = stamp - (at - this.zero) * cycle_ns;
        this.histogram.add(error);
        check_within(error, -48, 48, what);
    }
}

/// A board whose cameras, slaves, lines and triggers are as chance picks them. Camera 0 gets all of
/// its triggers.
class AnyCameras {
    constructor(seed) {
        this.random = random_numbers(seed);
        this.seed = 8 * seed;
        this.rig = new Rig(image, quick_usb);
        const rate_hz = 20 * 25 ** this.random();
        this.period = (1000 * cycles_per_ms) / rate_hz;
        this.bounce_ns = this.between(200, 4500); // less than the filter of the lines
        this.cameras = all_outputs.map((output) => this.add_camera(output));
        this.rig.machine.set_path(pin.loop, bad_pad(seed));
        this.rig.connect();
        this.rig.configure({
            cameras: this.cameras.map(({ is_slave, latency, exposure }) => ({
                flags: is_slave ? 0x11 : 1,
                latency: Math.round(latency * cycle_ns),
                rate_uhz: Math.round(rate_hz * 1e6),
                pulse: 10_000,
                exposure: Math.round(exposure * cycle_ns),
                max_exposure: Math.max(20_000, Math.round(1.5 * exposure * cycle_ns)),
            })),
        });
        this.rig.host.start();
        this.rig.run_ms(100 + 200_000 / rate_hz);
    }

    between(least, most) {
        return least + (most - least) * this.random();
    }

    /// Up to `most`, or often nothing.
    perhaps(most) {
        return this.random() < 0.5 ? 0 : this.between(0, most);
    }

    add_camera(output) {
        const { machine } = this.rig;
        const line = machine.set_path(pin.exposure + output, {
            rise_ns: this.between(0, 9),
            fall_ns: this.between(0, 9),
            shortest_ns: this.perhaps(40),
            loses: this.perhaps(0.3),
            bounces: Math.floor(this.perhaps(7)),
            bounce_ns: this.bounce_ns,
            jitter_ns: this.between(0, 3),
            seed: ++this.seed,
        });
        if (output > 0)
            machine.set_path(pin.trigger + output, { loses: this.perhaps(0.2), seed: ++this.seed });
        machine.set_input(pin.exposure + output, 0, 0);
        const longest = this.random() < 0.4 ? 7500 : this.period / 2;
        const camera = {
            line,
            is_slave: output > 0 && this.random() < 0.35,
            latency: this.between(100, 4000),
            exposure: this.between(1000, longest),
            triggers: [],
            frames: [],
        };
        this.rig.on_pin(pin.trigger + output, (cycle, level) => {
            if (level) this.expose(output, camera, cycle);
        });
        return camera;
    }

    /// The camera is triggered; while it exposes, it ignores that.
    expose(output, { triggers, frames, latency, exposure }, cycle) {
        triggers.push(cycle);
        if (frames.length > 0 && cycle < frames.at(-1).end) return;
        const start = cycle + latency + this.between(0, 200);
        const end = start + exposure * this.between(0.7, 1.3);
        frames.push({ cycle, start, end });
        this.rig.machine.set_input(pin.exposure + output, 1, start);
        this.rig.machine.set_input(pin.exposure + output, 0, end);
    }

    /// Checks what is measured. Returns of how many.
    judge() {
        this.zero = zero_of(this.rig, this.cameras[0]);
        const measured = this.rig.host.all('exposure').filter(is_measured);
        for (const record of measured) this.judge_exposure(record);
        check_nothing_lost(this.rig);
        return measured.length;
    }

    judge_exposure({ camera, trigger, triggered, start, end }) {
        const { line, is_slave, frames } = this.cameras[camera];
        const at = (stamp) => stamp / cycle_ns + this.zero;
        const all_bounced = (this.bounce_ns + 100) / cycle_ns;
        const is_at = (stamp, instant) => stamp > instant - 10 && stamp < instant + all_bounced;
        const frame = frames.find((each) => is_at(at(start), each.start));
        const what = `camera ${camera}, trigger ${trigger}`;
        check(frame !== undefined, `${what}: starts with no exposure`);
        // A slave whose trigger was lost may follow a bounce of its master.
        check(is_slave || at(triggered) === frame.cycle, `${what}: is of another trigger`);
        const error = (stamp, instant, level) => nearest(line.edges
            .filter((edge) => edge.level === level && is_at(edge.at, instant))
            .map((edge) => (at(stamp) - edge.at) * cycle_ns));
        check_within(error(start, frame.start, 1), -48, 48, 'start');
        check_within(error(end, frame.end, 0), -48, 48, 'end');
    }
}

const tests = {
    'edges of any phase, however near to each other, are stamped within 48 ns': () => {
        const any = new AnyPhase();
        while (any.histogram.count < wanted_edges) {
            any.rig.run_ms(50);
            any.judge();
        }
        check_nothing_lost(any.rig);
        any.histogram.print();
    },

    'exposures and pulses that bounce have the time of their first edge': () => {
        const bounce_ns = 3000;
        const path_of = (seed) => ({ ...bad_pad(seed), bounces: 4, bounce_ns });
        const rig = rig_behind(path_of, {
            cameras: all_outputs.map(() => ({ latency: 8000, rate_uhz: 100_000_000 })),
        });
        send_pulses(rig, 100, 1_250_000, 250_000);
        rig.run_ms(1000);
        const zero = zero_of(rig, rig.cameras[0]);
        const error_of = (stamp, change) =>
            nearest(change.instants.map((at) => stamp - (at - zero) * cycle_ns));
        const records = rig.host.all('exposure');
        check(records.length >= 4 * 150, `${records.length} records`);
        const changes = rig.lines.map((line) => settled_changes(line, bounce_ns));
        check(rig.lines[0].edges.length > 1.5 * changes[0].length, 'nothing bounces');
        for (const record of records) {
            const of_line = changes[record.camera];
            check(is_measured(record), `flags ${record.flags}`);
            check_within(error_of(record.start, of_line[2 * record.trigger - 2]), -48, 48, 'start');
            check_within(error_of(record.end, of_line[2 * record.trigger - 1]), -48, 48, 'end');
        }
        for (const input of rig.inputs) {
            const sent = events_of(rig, input);
            check(sent.length >= input.edges.length, `${sent.length} events ${input.event}`);
            // A pulse of an auxiliary input that bounces at its end is two.
            const rises = input.path.edges.filter(({ level }) => level === 1);
            for (const { time } of sent) {
                const errors = rises.map(({ at }) => time - (at - zero) * cycle_ns);
                check_within(nearest(errors), -48, 48, `event ${input.event}`);
            }
        }
        check_nothing_lost(rig);
    },

    'no exposure has the edges of another, whatever lies before the pins': () => {
        const boards = wanted_edges / 5000;
        let count = 0;
        for (let seed = 0; seed < boards; ++seed) count += new AnyCameras(seed).judge();
        check(count > 0.05 * wanted_edges, `${count} exposures`);
        process.stdout.write(`    ${count} exposures\n`);
    },

    'a data-ready line that bounces stamps samples by its first edges': () => {
        const bounce_ns = 2000;
        const rig = rig_behind(bad_pad);
        const period = 152_671.3;
        const ready = rig.machine.set_path(pin.imu_ready, {
            ...bad_pad(7),
            bounces: 4,
            bounce_ns,
        });
        const imu = new Icm42688p(rig.machine, {
            select: pin.spi_select,
            ready: pin.imu_ready,
            period,
            pulse: 2500, // what comes after 100 us is no echo
        });
        rig.host.stop();
        rig.run_ms(20);
        rig.configure({
            cameras: [{ latency: 8000 }],
            imus: [{ kind: 6, options: 1, rate_mhz: 1_000_000 }],
        });
        rig.run_until('set up the IMU', () => rig.host.has_event(10));
        rig.host.messages = [];
        rig.cameras[0].triggers.length = 0;
        rig.host.start();
        const from = rig.machine.now + cycles_per_ms;
        imu.run(from, from + 400 * period);
        rig.run_ms(400 * 1.2214 + 5);
        const zero = zero_of(rig, rig.cameras[0]);
        const changes = settled_changes(ready, bounce_ns).filter(({ level }) => level === 1);
        const samples = rig.host.all('imu');
        check(changes.length >= 400, `${changes.length} edges`);
        check(ready.edges.length > 3 * changes.length, 'nothing bounces');
        // A reading may begin with a level that is too short to be stamped, and is of no use then.
        check_within(changes.length - samples.length, 0, 20, 'edges without a sample');
        let next = samples[0].number;
        for (const { number, flags, time } of samples) {
            check(flags === (number === next ? 8 : 12), `sample ${number}: flags ${flags}`);
            next = number + 1;
            const errors = changes[number].instants.map((at) => time - (at - zero) * cycle_ns);
            check_within(nearest(errors), -48, 48, 'sample');
        }
    },

    'of pulses that a line loses, none takes the stamps of another': () => {
        const rig = rig_behind((seed) => ({ ...bad_pad(seed), loses: 0.2 }), {
            camera: { exposure: () => 60_000 },
            cameras: all_outputs.map(() => ({ latency: 8000, rate_uhz: 200_000_000 })),
        });
        send_pulses(rig, 200, 625_000, 12_500);
        rig.run_ms(500);
        const zero = zero_of(rig, rig.cameras[0]);
        for (const output of all_outputs) {
            const lost = check_exposures(rig, output, zero);
            check(lost > 30, `${lost} were lost`);
        }
        for (const input of rig.inputs) {
            const passed = input.path.edges.filter(({ level }) => level === 1);
            const sent = events_of(rig, input);
            check(passed.length < 180, `${passed.length} passed`);
            check(sent.length === passed.length, `${sent.length} events of ${passed.length}`);
            sent.forEach(({ time, value }) => {
                const { at } = passed[value - 1];
                check_within(time - (at - zero) * cycle_ns, -48, 48, `event ${input.event}`);
            });
        }
        check_nothing_lost(rig);
    },

    'without a free pin for the loop no exposure is measured, and all are with one': () => {
        for (const [what, path] of Object.entries(bad_loops)) {
            const { rig, camera } = rig_with_loop(path);
            rig.run_ms(1200);
            const records = rig.host.all('exposure');
            check(records.length >= camera.triggers.length - 2, `${records.length} records`);
            check(!records.some(is_measured), `some are measured with a loop that has ${what}`);
            check_loop(rig, 1, what);
            check(rig.host.last('health').edges_lost > 0, 'nothing is lost');
            check_free_loop(rig, camera);
        }
    },

    'a loop that fails for a while ends what is measured until it works again': () => {
        for (const [what, path] of Object.entries(bad_loops)) {
            const { rig, camera } = rig_with_loop();
            rig.run_ms(2500);
            check(rig.host.all('exposure').every(is_measured), 'not all are measured');
            rig.machine.set_path(pin.loop, path);
            rig.run_ms(2200); // by then it has risen and fallen
            const { length } = rig.host.messages;
            rig.run_ms(1200);
            const { messages } = rig.host;
            const records = messages.slice(length).filter(({ kind }) => kind === 'exposure');
            check(records.length > 50, `${records.length} records`);
            check(!records.some(is_measured), `some are measured with a loop that has ${what}`);
            check_loop(rig, 1, what);
            check_free_loop(rig, camera);
        }
    },

    'what the loop loses shifts no later stamp': () => {
        const { rig, camera } = rig_with_loop();
        rig.run_ms(2500);
        rig.machine.set_path(pin.loop, { loses: 1 });
        rig.run_ms(2200);
        check_free_loop(rig, camera);
    },

    'a storm of edges shifts no later stamp': () => {
        const rig = rig_behind(bad_pad, { camera: { exposure: () => 100_000 } });
        rig.run_ms(100);
        for (let storm = 0; storm < 3; ++storm) {
            const from = rig.machine.now + 1000;
            for (let i = 0; i < 2000; ++i)
                for (const [k, { gpio }] of rig.inputs.entries())
                    rig.machine.set_input(gpio, 1 - (i % 2), from + 80 * i + 20 * k);
            rig.run_ms(1300); // they are ignored for a second
            const { edges_lost: lost } = rig.host.last('health');
            check(lost > 500 * (storm + 1), `${lost} edges lost`);
        }
        const zero = zero_of(rig, rig.cameras[0]);
        for (const output of all_outputs) {
            const records = rig.host.all('exposure').filter(({ camera }) => camera === output);
            const { starts, ends, triggers } = rig.cameras[output];
            const measured = records.filter(is_measured);
            check(measured.length >= triggers.length - 10, `${measured.length} are measured`);
            for (const { trigger, start, end } of measured) {
                check_within(start - (starts[trigger - 1] - zero) * cycle_ns, -48, 56, 'start');
                check_within(end - (ends[trigger - 1] - zero) * cycle_ns, -48, 56, 'end');
            }
        }
    },

    'a trigger that does not leave gives no exposure, and no other is wrong': () => {
        for (const clamp of [0, 1]) {
            const rig = rig_behind(bad_pad);
            rig.run_ms(200);
            const clamped = rig.machine.set_path(pin.trigger + 2, { clamp });
            rig.run_ms(500);
            check(clamped.edges.length === 0, 'it is not clamped');
            const before = rig.cameras[2].triggers.length;
            rig.run_ms(500);
            check(rig.cameras[2].triggers.length === before, 'it is not clamped');
            rig.machine.set_path(pin.trigger + 2);
            rig.run_ms(500);
            const zero = zero_of(rig, rig.cameras[0]);
            for (const output of [0, 1, 3]) check_exposures(rig, output, zero);
            check_by_time(rig, 2, zero);
            check_nothing_lost(rig);
        }
    },

    'an exposure line that is held gives no exposure, and no other is wrong': () => {
        for (const clamp of [0, 1]) {
            const rig = rig_behind(bad_pad);
            rig.run_ms(203);
            const before = rig.lines[1].edges.length;
            rig.machine.set_path(pin.exposure + 1, { clamp });
            rig.run_ms(500);
            const edges = rig.lines[1].edges.slice(0, before);
            rig.lines[1] = rig.machine.set_path(pin.exposure + 1, bad_pad(1));
            rig.lines[1].edges.unshift(...edges);
            rig.run_ms(500);
            const zero = zero_of(rig, rig.cameras[0]);
            for (const output of [0, 2, 3]) check_exposures(rig, output, zero);
            check_by_time(rig, 1, zero);
            check_nothing_lost(rig);
        }
    },
};

run(tests);
