// SPDX-License-Identifier: BSD-3-Clause
// The real firmware on the emulated chip does what its ports promise, to the cycle.
//
// usage: firmware.mjs IMAGE.uf2 IMAGE.elf [NAME...]     NAME: part of a test's name
import { readFileSync } from 'node:fs';
import { Icm42688p } from './icm42688p.mjs';
import { Image } from './image.mjs';
import { Rig, busy_rig, cycle_ns, pin, quick_usb, zero_of } from './rig.mjs';
import { check, check_within, image, run, symbols } from './suite.mjs';

/// The board does nothing any more, as if its code had a loop without an end.
function hang(machine) {
    const { address } = new Image(readFileSync(symbols)).symbols.find(({ name }) =>
        name.endsWith('Board4pollEv'),
    );
    const branch_to_itself = 0xe7fe;
    machine.bus.ram[(address & ~1) - 0x20000000] = branch_to_itself & 0xff;
    machine.bus.ram[(address & ~1) + 1 - 0x20000000] = branch_to_itself >> 8;
}

/// Runs until the board stops by itself, and says why.
function end_of(rig, limit_ms) {
    return rig.machine.run_until(rig.machine.now + limit_ms * 125_000);
}

/// The board with the flash of another, which has stopped.
function next_life(rig) {
    const next = new Rig(image, quick_usb, rig.machine.reboot());
    next.connect();
    return next;
}

/// The board when power is back, which it lost now.
const after_power_cut = (rig) => new Rig(image, { ...quick_usb, flash: rig.machine.cut_power() });

/// Pulses of its own at the test output, as a configuration that needs no host.
const pulses_at = (test_rate_mhz) => ({
    store: true,
    ports: { test: 7, test_rate_mhz, pulse: 10_000 },
});

function count_pulses(rig, ms) {
    let pulses = 0;
    rig.on_pin(pin.test, (cycle, level) => (pulses += level ? 1 : 0));
    rig.run_ms(ms);
    return pulses;
}

/// How many microseconds each interrupt of priority 0 takes, from here on.
function urgent_times(machine) {
    const entry_and_exit = 28;
    const { interrupts } = machine;
    const times = [];
    const begin = interrupts.begin.bind(interrupts);
    const end = interrupts.end.bind(interrupts);
    let begun;
    interrupts.begin = (exception) => {
        if (interrupts.priority_of(exception) === 0) begun = machine.now;
        begin(exception);
    };
    interrupts.end = () => {
        const is_urgent = interrupts.priority_of(interrupts.active.at(-1)) === 0;
        if (is_urgent && begun !== undefined)
            times.push((machine.now - begun + entry_and_exit) * cycle_ns * 1e-3);
        end();
    };
    return times;
}

const tests = {
    'no output is driven before a configuration': () => {
        const rig = new Rig(image, quick_usb);
        const outputs = [19, 20, 21, 22, pin.sync, pin.test, pin.light];
        const driven = outputs.reduce((bits, gpio) => bits | (1 << gpio), 0);
        rig.connect();
        check((rig.machine.driven & driven) === 0, 'an output is driven');
        rig.configure({ cameras: { 0: {} } });
        check((rig.machine.driven & driven) === driven, 'an output is not driven');
    },

    'function and pad of each pin are stated at start': () => {
        const rig = new Rig(image, quick_usb);
        const { bus } = rig.machine;
        const written = new Map();
        const write = bus.write_register.bind(bus);
        bus.write_register = (address, value) => {
            written.set(address, value);
            write(address, value);
        };
        rig.connect();
        for (let gpio = 0; gpio < 30; ++gpio) {
            check(written.has(0x40014004 + 8 * gpio), `not the function of GPIO ${gpio}`);
            check(written.has(0x4001c004 + 4 * gpio), `not the pad of GPIO ${gpio}`);
        }
        // Of the Pico itself, or of a Pico W's radio, which 23 would switch on.
        for (const gpio of [23, 24, 25, 29])
            check((written.get(0x4001c004 + 4 * gpio) & 0xcc) === 4, `GPIO ${gpio} is not pulled down`);
        for (let number = 0; number < 6; ++number)
            check(written.has(0x40018004 + 8 * number), `not pin ${number} of the flash`);
    },

    'clocks run right whatever divided them before': () => {
        const rig = new Rig(image, quick_usb);
        const { values } = rig.machine.tree.clocks;
        for (const divider of [0x34, 0x40, 0x4c, 0x58]) values[divider] = 0x200;
        rig.connect();
        check(rig.machine.tree.clocks.peri_runs, 'clk_peri is divided');
    },

    'a trigger that is low when active rests high from its first moment on': () => {
        const rig = new Rig(image, quick_usb);
        const levels = [];
        rig.connect();
        rig.machine.watch([20]);
        const seen = rig.machine.on_output;
        rig.machine.on_output = (entry) => {
            if ((entry.driven >>> 20) & 1) levels.push((entry.levels >>> 20) & 1);
            rig.moved(entry);
        };
        rig.configure({ cameras: { 1: { flags: 3 } } });
        rig.run_ms(5);
        check(levels.length > 0 && levels.every((level) => level === 1), `levels ${levels}`);
    },

    'triggers are on the grid to the cycle, and cameras of a tick leave in the same one': () => {
        const rig = new Rig(image, quick_usb);
        // Each exposure and each camera has other fractions of what the stamps resolve.
        let exposures = 0;
        const cameras = [0, 1, 2, 3].map((output) =>
            rig.add_camera(output, {
                latency: 1000 + 7 * output,
                exposure: () => 125_000 + ((exposures++ * 13) % 64),
            }),
        );
        rig.connect();
        const camera = { latency: 8000, rate_uhz: 200_000_000, exposure: 1_000_000,
            max_exposure: 4_000_000 };
        const { origin } = rig.configure({ cameras: [camera, camera, camera, camera] });
        rig.host.start();
        rig.run_ms(300);
        const records = rig.host.all('exposure');
        check(records.length >= 4 * 55, `${records.length} records`);
        const zero = zero_of(rig, cameras[0]);
        for (const record of records) {
            const { triggers, starts, ends } = cameras[record.camera];
            const index = record.trigger - 1;
            const stamp_error = (stamp, cycle) => stamp - (cycle - zero) * cycle_ns;
            check(stamp_error(record.triggered, triggers[index]) === 0, 'trigger off its schedule');
            check_within(stamp_error(record.start, starts[index]), -48, 48, 'start');
            check_within(stamp_error(record.end, ends[index]), -48, 48, 'end');
            const middle = origin + record.tick * 5_000_000;
            // The exposures differ by up to 512 ns.
            check_within((record.start + record.end) / 2 - middle, -600, 600, 'middle');
        }
        check(rig.host.bad === 0 && rig.host.gaps === 0, 'packets were lost');
        check(rig.host.all('event').length === 0, JSON.stringify(rig.host.all('event')));
    },

    'cameras with equal exposures are triggered in the same cycle': () => {
        const rig = new Rig(image, quick_usb);
        const cameras = [0, 1, 2, 3].map((output) => rig.add_camera(output));
        rig.connect();
        rig.configure({ cameras: [0, 1, 2, 3].map(() => ({ latency: 8000 })) });
        rig.host.start();
        rig.run_ms(300);
        check(cameras[0].triggers.length >= 12, `${cameras[0].triggers.length} triggers`);
        for (const { triggers } of cameras)
            check(triggers.join() === cameras[0].triggers.join(), 'cameras are not in step');
    },

    'a slave follows its master within 50 ns, and the light the exposures within 100 ns': () => {
        const rig = new Rig(image, quick_usb);
        const master = rig.add_camera(0, { latency: 1003 });
        const slave = rig.add_camera(1, { latency: 1000, exposure: () => 200_000 });
        const lights = [];
        rig.on_pin(pin.light, (cycle, level) => lights.push({ cycle, level }));
        rig.connect();
        rig.configure({
            cameras: [{ latency: 8024 }, { flags: 17, master: 0, latency: 8000 }],
            light: { cameras: 1, lead: 0, longest: 10_000_000, duty_ppm: 1_000_000 },
        });
        rig.host.start();
        rig.run_ms(300);
        check(slave.triggers.length >= 10, `${slave.triggers.length} pulses of the slave`);
        const behind = (cycle, cycles) => cycles.map((each) => (cycle - each) * cycle_ns)
            .filter((ns) => ns >= 0).reduce((least, ns) => Math.min(least, ns), Infinity);
        for (const cycle of slave.triggers)
            check_within(behind(cycle, master.starts), 0, 50, 'slave');
        check(lights.length >= 20, `${lights.length} changes of the light`);
        for (const { cycle, level } of lights)
            check_within(behind(cycle, level ? master.starts : master.ends), 0, 100, 'light');
        check(rig.host.all('event').length === 0, JSON.stringify(rig.host.all('event')));
    },

    'the light follows its cameras and no others, whichever they are': () => {
        for (let cameras = 1; cameras < 16; ++cameras) {
            const rig = new Rig(image, quick_usb);
            const exposing = [0, 0, 0, 0];
            rig.connect();
            const at = [0, 1, 2, 3].map((output) =>
                rig.add_camera(output, { exposure: () => 20_000 + 10_101 * output }),
            );
            const lights = [];
            rig.on_pin(pin.light, (cycle, level) => lights.push({ cycle, level }));
            rig.configure({
                // Each is alone for a while, and some are together.
                cameras: [0, 1, 2, 3].map((i) => ({ latency: 8000, phase: i * 200_000 })),
                light: { cameras, lead: 0, longest: 10_000_000, duty_ppm: 1_000_000 },
            });
            rig.host.start();
            rig.run_ms(300);
            const edges = at.flatMap(({ starts, ends }, output) => [
                ...starts.map((cycle) => ({ cycle, output, change: 1 })),
                ...ends.map((cycle) => ({ cycle, output, change: 0 })),
            ]).sort((a, b) => a.cycle - b.cycle);
            const wanted = [];
            for (const { cycle, output, change } of edges) {
                const before = exposing.some((level, i) => level && (cameras >> i) & 1);
                exposing[output] = change;
                const now = exposing.some((level, i) => level && (cameras >> i) & 1);
                if (now !== before) wanted.push({ cycle, level: now });
            }
            check(wanted.length >= 20, `${wanted.length} lights of ${cameras}`);
            check(lights.length === wanted.length, `${lights.length} of ${wanted.length} changes`);
            lights.forEach(({ cycle, level }, i) => {
                check(level === wanted[i].level, `level of ${cameras}`);
                check_within((cycle - wanted[i].cycle) * cycle_ns, -88, 160, 'light');
            });
        }
    },

    'a lead begins when it should, and a line that is stuck is lit no longer than allowed': () => {
        const rig = new Rig(image, quick_usb);
        const camera = rig.add_camera(0, { exposure: (index) => (index < 5 ? 200_000 : 1e9) });
        const lights = [];
        rig.on_pin(pin.light, (cycle, level) => lights.push({ cycle, level }));
        rig.connect();
        rig.configure({
            cameras: [{ latency: 8000 }],
            light: { cameras: 1, lead: 100_000, longest: 3_000_000, duty_ppm: 100_000 },
        });
        rig.host.start();
        rig.run_ms(500);
        check(lights.length >= 12, `${lights.length} changes`);
        lights.slice(0, 10).forEach(({ cycle, level }, i) => {
            const edge = level ? camera.starts[i / 2] : camera.ends[(i - 1) / 2];
            check_within((cycle - edge) * cycle_ns, level ? -100_008 : 0, level ? -99_992 : 100,
                level ? 'lead' : 'end');
        });
        check_within((lights[11].cycle - lights[10].cycle) * cycle_ns, 100_000, 3_000_100, 'stuck');
    },

    'code that hangs leaves no light': () => {
        const rig = new Rig(image, quick_usb);
        rig.add_camera(0, { exposure: () => 1e9 });
        let lit = 0;
        const lights = [];
        rig.on_pin(pin.light, (cycle, level) => {
            lights.push({ cycle, level });
            if (level) lit = cycle;
        });
        rig.connect();
        rig.configure({
            cameras: [{ latency: 8000 }],
            light: { cameras: 1, lead: 0, longest: 3_000_000, duty_ppm: 1_000_000 },
        });
        rig.host.start();
        rig.run_until('lit', () => lit !== 0);
        hang(rig.machine);
        rig.run_ms(50);
        check(lights.length === 2 && !lights[1].level, 'it is lit');
        check_within((lights[1].cycle - lit) * cycle_ns, 0, 3_000_100, 'light');
    },

    'an IMU is read within 2 us of its edge, and each sample has the edge\'s stamp': () => {
        const rig = new Rig(image, quick_usb);
        const camera = rig.add_camera(0);
        const period = 152_671; // 819 Hz
        const imu = new Icm42688p(rig.machine, {
            select: pin.spi_select,
            ready: pin.imu_ready,
            period,
        });
        rig.connect();
        rig.configure({
            cameras: [{ latency: 8000 }],
            imus: [{ kind: 6, options: 1, rate_mhz: 1_000_000 }],
        });
        rig.run_until('set up the IMU', () => rig.host.has_event(10));
        rig.host.start();
        const from = rig.machine.now + 125_000;
        imu.run(from, from + 200 * period);
        rig.run_ms(200 * 1.2214 + 5);
        const zero = zero_of(rig, camera);
        const samples = rig.host.all('imu');
        check(samples.length === 200, `${samples.length} samples of 200`);
        samples.forEach((sample, index) => {
            const edge = (imu.edges[index] - zero) * cycle_ns;
            check((sample.flags & ~8) === 0 && (sample.flags & 8) !== 0, `flags ${sample.flags}`);
            check_within(sample.time - edge, -48, 48, 'stamp of a sample');
            check(sample.accel[0] === index + 1 + 1, `sample ${index} is ${sample.accel}`);
        });
        imu.begins.forEach((begin, index) =>
            check_within((begin - imu.edges[index]) * cycle_ns, 0, 2000, 'first clock'),
        );
    },

    'an IMU at 4 kHz and four cameras at 200 Hz with light are not too much': () => {
        const rig = new Rig(image, quick_usb);
        const period = 31_235; // by and by, each phase between edge and grid point
        const imu = new Icm42688p(rig.machine, {
            select: pin.spi_select,
            ready: pin.imu_ready,
            period,
        });
        for (const output of [0, 1, 2, 3]) rig.add_camera(output, { exposure: () => 125_000 });
        rig.connect();
        const camera = { latency: 8000, rate_uhz: 200_000_000, exposure: 1_000_000,
            max_exposure: 3_000_000 };
        rig.configure({
            cameras: [camera, camera, camera, camera],
            imus: [{ kind: 6, options: 1, rate_mhz: 4_000_000 }],
            light: { cameras: 15, lead: 0, longest: 3_000_000, duty_ppm: 1_000_000 },
        });
        rig.run_until('set up the IMU', () => rig.host.has_event(10));
        rig.host.start();
        const from = rig.machine.now + 125_000;
        imu.run(from, from + 2000 * period);
        rig.run_ms(505);
        const samples = rig.host.all('imu');
        check(samples.length === 2000, `${samples.length} samples of 2000`);
        check(samples.every(({ flags }) => flags === 8), 'a sample is flagged');
        check(rig.host.all('event').length === 1, JSON.stringify(rig.host.all('event').slice(1)));
        check(rig.host.all('exposure').every(({ flags }) => flags === 1), 'an exposure is flagged');
    },

    'readings that a new configuration ends leave nothing behind': () => {
        for (const options of [1, 5]) {
            const rig = new Rig(image, quick_usb);
            const is_i2c = options === 5;
            const period = is_i2c ? 125_000 : 31_250;
            const imu = new Icm42688p(rig.machine, {
                select: is_i2c ? undefined : pin.spi_select,
                ready: pin.imu_ready,
                period,
            });
            rig.connect();
            const rate_mhz = is_i2c ? 1_000_000 : 4_000_000;
            const settings = (filter) => ({ imus: [{ kind: 6, options, filter, rate_mhz }] });
            imu.run(rig.machine.now, rig.machine.now + 3_000 * 125_000);
            for (let filter = 0; filter < 16; ++filter) {
                rig.configure(settings(filter % 2));
                const before = rig.host.all('imu').length;
                rig.run_until('read', () => rig.host.all('imu').length > before + 5);
                rig.run_ms(1 + filter * 0.037);
            }
            check(rig.host.all('imu').every(({ flags }) => (flags & 3) === 0), 'a bad sample');
            check(!rig.host.has_event(11) && !rig.host.has_event(12), 'a failure');
        }
    },

    'the test output copies a data-ready line, and sync pulses leave at their rate': () => {
        const rig = new Rig(image, quick_usb);
        const imu = new Icm42688p(rig.machine, {
            select: pin.spi_select,
            ready: pin.imu_ready,
            period: 152_439,
        });
        const copies = [];
        const syncs = [];
        rig.on_pin(pin.test, (cycle, level) => level && copies.push(cycle));
        rig.on_pin(pin.sync, (cycle, level) => level && syncs.push(cycle));
        rig.connect();
        rig.configure({
            imus: [{ kind: 6, options: 1, rate_mhz: 1_000_000 }],
            ports: { test: 5, sync_rate_uhz: 10_000_000, pulse: 10_000 },
        });
        const from = rig.machine.now + 125_000;
        imu.run(from, from + 500 * 152_439);
        rig.run_ms(600);
        check(copies.length >= 480 && syncs.length >= 5, `${copies.length}, ${syncs.length}`);
        copies.forEach((cycle, index) =>
            check_within((cycle - imu.edges[index]) * cycle_ns, 0, 50, 'copy'),
        );
        for (let i = 1; i < syncs.length; ++i)
            check(syncs[i] - syncs[i - 1] === 12_500_000, `sync after ${syncs[i] - syncs[i - 1]}`);
    },

    'an IMU on I2C is read, and each sample has its edge\'s stamp': () => {
        const rig = new Rig(image, quick_usb);
        const camera = rig.add_camera(0);
        const period = 250_000; // 500 Hz
        const imu = new Icm42688p(rig.machine, { ready: pin.imu_ready, period });
        rig.connect();
        rig.configure({
            cameras: [{ latency: 8000 }],
            imus: [{ kind: 6, options: 5, rate_mhz: 500_000 }],
        });
        rig.run_until('set up the IMU', () => rig.host.has_event(10));
        rig.host.start();
        const from = rig.machine.now + 125_000;
        imu.run(from, from + 50 * period);
        rig.run_ms(110);
        const zero = zero_of(rig, camera);
        const samples = rig.host.all('imu');
        check(samples.length === 50, `${samples.length} samples of 50`);
        samples.forEach((sample, index) => {
            const edge = (imu.edges[index] - zero) * cycle_ns;
            check(sample.flags === 8, `flags ${sample.flags}`);
            check_within(sample.time - edge, -48, 48, 'stamp of a sample');
            check(sample.accel[0] === index + 1 + 1, `sample ${index} is ${sample.accel}`);
        });
    },

    'a reading on I2C is not taken for one that hung nine milliseconds before': () => {
        const rig = new Rig(image, quick_usb);
        const imu = new Icm42688p(rig.machine, { ready: pin.imu_ready });
        rig.connect();
        rig.configure({ imus: [{ kind: 6, options: 5, rate_mhz: 100_000 }] });
        rig.run_until('set up the IMU', () => rig.host.has_event(10));
        let edge = rig.machine.now + 125_000;
        for (let us = 470; us <= 490; us += 0.25) {
            imu.period = Math.round(125 * (9_000 + us));
            imu.run(edge, edge + 1);
            edge += imu.period;
        }
        rig.run_ms((edge - rig.machine.now) / 125_000);
        const samples = rig.host.all('imu');
        check(samples.length === imu.edges.length, `${samples.length} of ${imu.edges.length}`);
        check(samples.every(({ flags }) => flags === 8), 'a sample is flagged');
    },

    'an I2C bus without a part is reported, and harms nothing else': () => {
        const rig = new Rig(image, quick_usb);
        const camera = rig.add_camera(0);
        rig.connect();
        rig.configure({
            cameras: [{ latency: 8000 }],
            imus: [{ kind: 6, options: 5, rate_mhz: 500_000 }],
        });
        rig.host.start();
        rig.run_ms(300);
        check(rig.host.has_event(11) || rig.host.has_event(12), 'a missing IMU is not reported');
        check(camera.triggers.length >= 12, `${camera.triggers.length} triggers`);
    },

    'a sentence at the UART names the pulse before it': () => {
        const rig = new Rig(image, quick_usb);
        rig.machine.set_input(pin.pps, 0, 0);
        rig.connect();
        rig.configure({ ports: { inputs: 1, options: 2 } });
        const pulse = rig.machine.now + 125_000;
        rig.machine.set_input(pin.pps, 1, pulse);
        rig.machine.set_input(pin.pps, 0, pulse + 125_000);
        const body = 'GPRMC,120000.00,A,4722.6,N,00832.9,E,0.0,0.0,010120,,,A';
        const sum = [...body].reduce((all, letter) => all ^ letter.charCodeAt(0), 0);
        const digits = sum.toString(16).toUpperCase().padStart(2, '0');
        const sentence = `$${body}*${digits}\r\n`;
        rig.machine.uart[0].send(Buffer.from(sentence), pulse + 6_250_000, 9600);
        rig.run_ms(200);
        const named = rig.host.all('event').filter(({ event }) => event === 13);
        check(named.length === 1, `${named.length} names`);
        check(named[0].value === Date.UTC(2020, 0, 1, 12) / 1000, `it is ${named[0].value}`);
        const pulse_event = rig.host.all('event').find(({ event }) => event === 5);
        check(named[0].time === pulse_event.time, 'time');
    },

    'a clock answer says when the request came and when it left, to 2 us': () => {
        const rig = new Rig(image, quick_usb);
        const camera = rig.add_camera(0);
        const sent = [];
        const came = [];
        rig.connect();
        rig.configure({ cameras: [{}] });
        rig.host.start();
        rig.run_ms(50);
        const zero = zero_of(rig, camera);
        rig.machine.usb.logs = true;
        rig.machine.usb.log.length = 0;
        for (let id = 0; id < 20; ++id) {
            rig.host.ask_time(id);
            rig.run_ms(3.37);
        }
        for (const entry of rig.machine.usb.log) {
            if (entry.result !== 'ack' || entry.endpoint !== 1) continue;
            if (entry.kind === 'out') sent.push(entry.cycle);
            if (entry.kind === 'in') came.push(entry.cycle);
        }
        // The log has the ends of transactions, with the handshake and the gap before it.
        const handshake_ns = (19 + 4) * (1000 / 12);
        const answers = rig.host.all('clock');
        const follow_ups = rig.host.all('follow_up');
        check(answers.length === 20 && follow_ups.length === 20, `${answers.length} answers`);
        const nearest = (ns, cycles) => cycles
            .map((cycle) => ns - (cycle - zero) * cycle_ns + handshake_ns)
            .reduce((best, error) => (Math.abs(error) < Math.abs(best) ? error : best), Infinity);
        for (const { received } of answers)
            check_within(nearest(received, sent), -2000, 2000, 'received');
        for (const follow_up of follow_ups)
            check_within(nearest(follow_up.sent, came), -2000, 0, 'sent');
    },

    'after the port was opened anew, answers still say when they left': () => {
        const rig = busy_rig(image, 1, 152_439);
        const { usb } = rig.machine;
        const { camera } = rig;
        rig.run_ms(50);
        const zero = zero_of(rig, camera);
        const left = new Map(); // cycles, by the number of the answer
        const { on_bytes } = usb;
        usb.on_bytes = (bytes, cycle) => {
            const before = rig.host.all('clock').length;
            on_bytes(bytes, cycle);
            for (const { id } of rig.host.all('clock').slice(before)) left.set(id, cycle);
        };
        const handshake_ns = (19 + 4) * (1000 / 12);
        const opened = 60;
        for (let id = 0; id < opened; ++id) {
            usb.set_reading(false); // so that a packet waits, and what follows queues up
            rig.run_ms(2 + 0.017 * id);
            usb.set_line_state(false, false);
            usb.set_line_state(true, true);
            rig.run_ms(1); // what follows half a message is lost with it
            rig.host.ask_time(id);
            rig.run_ms(2);
            usb.set_reading(true);
            rig.run_ms(10.1);
        }
        const follow_ups = rig.host.all('follow_up').filter(({ id }) => left.has(id));
        check(left.size >= opened * 0.8, `${left.size} answers`);
        check(follow_ups.length === left.size, `${follow_ups.length} of ${left.size} left`);
        for (const { id, sent } of follow_ups) {
            const error = sent - (left.get(id) - zero) * cycle_ns + handshake_ns;
            check_within(error, -2000, 0, 'sent');
        }
    },

    'a hub that corrupts what ends late in a frame does not hang the controller': () => {
        const rig = busy_rig(image, 1, 152_439);
        rig.machine.usb.corrupts = 'deaf';
        rig.run_ms(500);
        check(rig.machine.usb_device.hung === undefined, 'it hangs');
        const { bad, gaps } = rig.host;
        check(bad === 0 && gaps === 0, `${bad} bad packets, ${gaps} gaps`);
    },

    'a controller that hangs is reset, while triggers and stamps go on': () => {
        for (const kind of ['deaf', 'failed', 'mute']) {
            const rig = busy_rig(image, 1, 152_439);
            const { usb, usb_device } = rig.machine;
            const { camera } = rig;
            rig.run_ms(100);
            const { nonce } = rig.host;
            usb.set_reading(false); // so that a packet waits
            rig.run_ms(5);
            usb.set_reading(true);
            usb_device.hang(kind);
            if (kind === 'mute') usb.reset(); // as a host does when nobody answers
            rig.run_until('lost', () => usb.state === 'detached', kind === 'deaf' ? 700 : 2200);
            rig.run_until('configured again', () => usb.state === 'configured');
            usb.set_line_state(true, true);
            rig.host.pending = [];
            rig.run_ms(100);
            check(rig.host.nonce === nonce, 'the board was reset');
            const records = rig.host.all('exposure').filter((record) => record.camera === 0);
            const zero = zero_of(rig, camera);
            for (const { trigger, triggered, flags } of records) {
                const at = (camera.triggers[trigger - 1] - zero) * cycle_ns;
                check(triggered === at && (flags & 1) !== 0, `${kind}: trigger ${trigger}`);
            }
            const missed = camera.triggers.length - records.at(-1).trigger;
            check(missed <= 2, `${kind}: ${missed} records are missing at the end`);
            camera.triggers.slice(1).forEach((cycle, index) =>
                check_within(cycle - camera.triggers[index], 2_499_990, 2_500_010, 'period'));
        }
    },

    'a host that sleeps, is unplugged or does not read resets nothing': () => {
        const rig = busy_rig(image, 1, 152_439);
        const { usb, usb_device } = rig.machine;
        const attach = usb.on_attach.bind(usb);
        let left = 0;
        usb.on_attach = (is_attached) => {
            ++left;
            attach(is_attached);
        };
        const still_answers = (id) => {
            rig.host.ask_time(id);
            rig.run_until('an answer', () => rig.host.last('clock')?.id === id);
        };
        usb.set_reading(false);
        rig.run_ms(2000);
        usb.set_reading(true);
        still_answers(1);
        usb.suspend();
        rig.run_ms(2000);
        check(usb.state === 'suspended', `it is ${usb.state}`);
        usb.resume();
        rig.run_ms(30);
        still_answers(2);
        for (let i = 0; i < 20; ++i) {
            usb_device.status |= 1 << 24; // a packet failed, and succeeded at the second attempt
            rig.run_ms(100);
        }
        still_answers(3);
        const { bad, gaps } = rig.host;
        check(bad === 0 && gaps === 0, `${bad} bad packets, ${gaps} gaps`);
        usb.disconnect();
        rig.run_ms(2000);
        usb.connect();
        rig.run_until('configured again', () => usb.state === 'configured');
        check(left === 0, 'it left the bus');
    },

    'a bus that is busy after resets is joined in the end': () => {
        const rig = new Rig(image, quick_usb);
        rig.machine.usb.busy_resets = 2;
        rig.run_until('configured', () => rig.machine.usb.state === 'configured', 3000);
        rig.connect();
    },

    'halts of endpoints are set, reported and cleared; nothing is lost by it': () => {
        const rig = busy_rig(image, 1, 152_439);
        const { usb } = rig.machine;
        const asked = (request) => {
            let result;
            usb.control(request, (found) => (result = found));
            rig.run_until('the request ends', () => result !== undefined);
            return typeof result === 'string' ? result : [...result];
        };
        const status = (index) => asked({ type: 0x82, request: 0, index, length: 2 })[0];
        const { bulk_in, bulk_out, notify } = usb.endpoints;
        let id = 0;
        const read_again = () => {
            usb.set_reading(true);
            rig.host.ask_time(++id);
            rig.run_until('an answer', () => rig.host.last('clock')?.id === id);
        };
        for (const endpoint of [0x80 | bulk_in, bulk_out, 0x80 | notify])
            for (let i = 0; i < 5; ++i) {
                usb.set_reading(false);
                rig.run_ms(3.3);
                check(asked({ type: 2, request: 3, index: endpoint }).length === 0, 'not halted');
                check(status(endpoint) === 1, `${endpoint} is not said to be halted`);
                let cleared = false;
                usb.clear_halt(endpoint, (result) => (cleared = result.length === 0));
                rig.run_until(`${endpoint} is cleared`, () => cleared);
                check(status(endpoint) === 0, `${endpoint} is said to be halted`);
                read_again();
            }
        for (let i = 0; i < 3; ++i) {
            usb.set_reading(false);
            rig.run_ms(3.3);
            check(asked({ type: 1, request: 11, index: 1 }).length === 0, 'set interface');
            usb.in_data1 = usb.out_data1 = false;
            read_again();
        }
        check(asked({ type: 2, request: 1, index: 0 }).length === 0, 'endpoint 0');
        for (const endpoint of [0x83, 0x02])
            check(asked({ type: 2, request: 1, index: endpoint }) === 'stall', 'not refused');
        const { bad, gaps } = rig.host;
        check(bad === 0 && gaps === 0, `${bad} bad packets, ${gaps} gaps`);
    },

    'pulses at the inputs are stamped within 48 ns': () => {
        const rig = new Rig(image, quick_usb);
        const camera = rig.add_camera(0);
        const inputs = [
            { gpio: pin.pps, event: 5 },
            { gpio: pin.aux0, event: 6 },
            { gpio: pin.sync_input, event: 7 },
        ];
        for (const { gpio } of inputs) rig.machine.set_input(gpio, 0, 0);
        rig.connect();
        rig.configure({ cameras: [{}], ports: { inputs: 0b1011 } });
        rig.host.start();
        const from = rig.machine.now;
        inputs.forEach((input, index) => {
            input.edges = Array.from({ length: 20 }, (_, k) => from + k * 625_013 + index * 1_009);
            for (const edge of input.edges) {
                rig.machine.set_input(input.gpio, 1, edge);
                rig.machine.set_input(input.gpio, 0, edge + 12_500);
            }
        });
        rig.run_ms(120);
        const zero = zero_of(rig, camera);
        for (const { event, edges } of inputs) {
            const stamps = rig.host.all('event').filter((sent) => sent.event === event);
            check(stamps.length === edges.length, `${stamps.length} events ${event}`);
            stamps.forEach(({ time }, index) =>
                check_within(time - (edges[index] - zero) * cycle_ns, -48, 48, `event ${event}`),
            );
        }
    },

    'a line that never rests is ignored, and harms nothing else': () => {
        const rig = new Rig(image, quick_usb);
        const camera = rig.add_camera(0);
        rig.connect();
        rig.configure({ cameras: [{ latency: 8000 }], ports: { inputs: 0b10 } });
        rig.host.start();
        const from = rig.machine.now;
        for (let k = 0; k < 20_000; ++k) rig.machine.set_input(pin.aux0, k % 2, from + 60 * k);
        rig.run_ms(300);
        const events = rig.host.all('event');
        const ignored = events.some(({ event, source }) => event === 8 && source === 7);
        check(ignored, 'it was not ignored');
        const measured = rig.host.all('exposure').filter(({ flags }) => (flags & 1) !== 0);
        check(measured.length >= camera.triggers.length - 2, `${measured.length} exposures`);
    },

    'what a host did not read in time is reported, and nothing else is wrong': () => {
        const rig = new Rig(image, quick_usb);
        rig.add_camera(0, { exposure: () => 12_500 });
        rig.connect();
        rig.configure({
            cameras: [{ rate_uhz: 1_000_000_000, pulse: 10_000, latency: 8000, exposure: 100_000,
                max_exposure: 500_000 }],
        });
        rig.host.start();
        rig.run_ms(50);
        rig.machine.usb.set_reading(false);
        rig.run_ms(400);
        rig.machine.usb.set_reading(true);
        rig.run_ms(1200);
        const { bad, gaps } = rig.host;
        check(bad === 0 && gaps === 0, `${bad} bad packets, ${gaps} gaps`);
        const triggers = rig.host.all('exposure').map(({ trigger }) => trigger);
        const missing = triggers.at(-1) - triggers.length;
        const { replaced } = rig.host.last('health');
        check(missing > 50 && missing === replaced, `${missing} missing, ${replaced} reported`);
    },

    'the serial number is the one of the flash chip': () => {
        const rig = new Rig(image, quick_usb);
        rig.connect();
        const { serial } = rig.host.last('hello');
        const id = Buffer.from(rig.machine.flash.unique_id).toString('hex').toUpperCase();
        check(serial === id, `the serial number is ${serial}, not ${id}`);
    },

    'a board restarts on request, and says so': () => {
        const rig = new Rig(image, quick_usb);
        rig.connect();
        const { serial } = rig.host.last('hello');
        rig.host.reboot(false);
        check(end_of(rig, 100) === 'watchdog', 'it did not restart');
        const hello = next_life(rig).host.last('hello');
        check(hello.reset_cause === 4 && hello.serial === serial, JSON.stringify(hello));
    },

    'the boot loader comes on request': () => {
        const rig = new Rig(image, quick_usb);
        rig.connect();
        rig.host.reboot(true);
        check(end_of(rig, 100) === 'boot loader', 'no boot loader');
        const updated = next_life(rig);
        check(updated.host.last('hello').reset_cause === 5, 'it does not say update');
        // The next life is another matter.
        hang(updated.machine);
        check(end_of(updated, 1100) === 'watchdog', 'no reset');
        check(next_life(updated).host.last('hello').reset_cause === 2, 'another cause');
    },

    'a new board that its boot loader started says so': () => {
        const rig = new Rig(image, { ...quick_usb, reason: 1 });
        rig.connect();
        check(rig.host.last('hello').reset_cause === 5, 'it does not say update');
    },

    'the boot loader comes by a touch at 1200 baud, even when the code hangs': () => {
        const rig = new Rig(image, quick_usb);
        rig.connect();
        hang(rig.machine);
        rig.run_ms(10);
        rig.machine.usb.set_line_coding(1200);
        rig.machine.usb.set_line_state(false, false);
        check(end_of(rig, 100) === 'boot loader', 'no boot loader');
        check(next_life(rig).host.last('hello').reset_cause === 5, 'it does not say update');
    },

    'code that hangs is ended by the watchdog within a second': () => {
        const rig = new Rig(image, quick_usb);
        rig.connect();
        hang(rig.machine);
        check(end_of(rig, 1100) === 'watchdog', 'no reset');
        check(next_life(rig).host.last('hello').reset_cause === 2, 'another cause');
    },

    'a stored configuration is in force from power-up': () => {
        const rig = new Rig(image, quick_usb);
        rig.connect();
        rig.configure(pulses_at(1_000_000));
        rig.run_until('stored', () =>
            rig.host.all('event').some(({ event, value }) => event === 17 && value === 1),
        );
        const next = after_power_cut(rig);
        const pulses = count_pulses(next, 50);
        check(pulses >= 40 && pulses <= 50, `${pulses} pulses in 50 ms`);
        next.connect();
        check(next.host.last('hello').reset_cause === 0, 'another cause');
    },

    'without power in the middle of storing, the old or the new configuration remains': () => {
        const rig = new Rig(image, quick_usb);
        rig.connect();
        rig.configure(pulses_at(1_000_000));
        rig.run_ms(200);
        rig.configure(pulses_at(2_000_000));
        const found = new Set();
        for (let cut = 0; cut < 60; ++cut) {
            const next = after_power_cut(rig);
            next.run_ms(5);
            const rate = Math.round(count_pulses(next, 20) / 20);
            check(rate === 1 || rate === 2, `${rate} kHz after cut ${cut}`);
            found.add(rate);
            rig.run_ms(cut < 20 ? 0.3 : 1.7);
        }
        check(found.size === 2, 'not both were found');
    },

    'nothing slips when the stamps\' counter wraps, after 68.7 s': () => {
        const rig = new Rig(image, quick_usb);
        const camera = rig.add_camera(0);
        rig.connect();
        rig.configure({ cameras: [{ latency: 8000, rate_uhz: 5_000_000 }] });
        rig.host.start();
        rig.run_ms(75_000);
        const zero = zero_of(rig, camera);
        const records = rig.host.all('exposure');
        check(records.length >= 370, `${records.length} records`);
        for (const { trigger, triggered, start, end } of records) {
            const at = (cycle) => (cycle - zero) * cycle_ns;
            check(triggered === at(camera.triggers[trigger - 1]), `trigger ${trigger}`);
            check_within(start - at(camera.starts[trigger - 1]), -48, 48, 'start');
            check_within(end - at(camera.ends[trigger - 1]), -48, 48, 'end');
        }
    },

    'the most urgent interrupts take at most 1 us, entry and exit included': () => {
        for (const options of [0, 1, 5]) {
            const rig = busy_rig(image, options, 125_000);
            const times = urgent_times(rig.machine);
            rig.run_ms(600);
            check(times.length > 1000, `${times.length} of them`);
            for (const us of times) check_within(us, 0, 1, 'interrupt');
        }
    },
};

run(tests);
