// SPDX-License-Identifier: BSD-3-Clause
// The firmware on the emulated chip, with cameras at its pins and a host on its USB.
import { readFileSync } from 'node:fs';
import { Icm42688p } from './icm42688p.mjs';
import { Machine } from './machine.mjs';
import { Host } from './protocol.mjs';

export const cycle_ns = 8;
export const cycles_of_ns = (ns) => Math.round(ns / cycle_ns);
const cycles_per_ms = 125_000;

export const pin = { exposure: 14, loop: 18, trigger: 19, sync: 26, test: 27, light: 28,
    imu_ready: 7, spi_select: 5, pps: 10, aux0: 11, aux1: 12, sync_input: 13 };

/// A host that waits for nothing.
export const quick_usb = { usb_times: { debounce_ms: 1, reset_ms: 1, recovery_ms: 1 } };

/// The cycle at which the board's time is 0, by its first exposure record.
export function zero_of(rig, camera, output = 0) {
    const first = rig.host.all('exposure').find((record) => record.camera === output);
    return camera.triggers[first.trigger - 1] - first.triggered / cycle_ns;
}

export class Rig {
    /// On `machine`, or a new one that starts from the image.
    constructor(image, options = {}, machine = undefined) {
        this.machine =
            machine ?? new Machine({ flash: readFileSync(image), ram_only: true, ...options });
        this.machine.watch([19, 20, 21, 22, 26, 27, 28]);
        this.listeners = [];
        this.levels = 0;
        this.machine.on_output = (entry) => this.moved(entry);
        this.host = new Host((bytes) => this.machine.usb.write(bytes));
        this.machine.usb.on_bytes = (bytes) => this.host.receive(bytes);
    }

    moved({ cycle, levels, driven }) {
        const now = levels & driven;
        const changed = now ^ this.levels;
        this.levels = now;
        const from = cycle + 1; // a level is there when the cycle of its driver has ended
        for (const listener of this.listeners) {
            const bit = 1 << listener.gpio;
            if (changed & bit) listener.call(from, (now & bit) !== 0);
        }
    }
    on_pin(gpio, call) {
        this.listeners.push({ gpio, call });
    }

    /// A camera at this output; returns what happened: cycles of triggers and exposures. Its times
    /// may lie between two cycles; those of each exposure follow from the exposures before.
    add_camera(
        output,
        { latency = 1000, latency_of = () => latency, exposure = () => 375_000 } = {},
    ) {
        const camera = { triggers: [], starts: [], ends: [] };
        this.machine.set_input(pin.exposure + output, 0, 0);
        this.on_pin(pin.trigger + output, (cycle, level) => {
            if (!level) return;
            const start = cycle + latency_of(camera.triggers.length);
            const end = start + exposure(camera.triggers.length);
            camera.triggers.push(cycle);
            camera.starts.push(start);
            camera.ends.push(end);
            this.machine.set_input(pin.exposure + output, 1, start);
            this.machine.set_input(pin.exposure + output, 0, end);
        });
        return camera;
    }

    run_ms(ms) {
        const why = this.machine.run_until(this.machine.now + Math.round(ms * cycles_per_ms));
        if (why !== 'time') throw new Error(`the board stopped: ${why}`);
    }

    /// Runs until `condition` holds, at most so long.
    run_until(what, condition, limit_ms = 1000) {
        for (let ms = 0; ms < limit_ms; ++ms) {
            if (condition()) return;
            this.run_ms(1);
        }
        throw new Error(`not within ${limit_ms} ms: ${what}`);
    }

    connect() {
        this.run_until('configured on USB', () => this.machine.usb.state === 'configured');
        this.machine.usb.set_line_state(true, true);
        this.run_ms(5);
        this.host.hello();
        this.run_until('hello', () => this.host.last('hello') !== undefined);
    }

    configure(configuration) {
        const before = this.host.all('answer').length;
        this.host.configure(configuration);
        this.run_until('configured', () => this.host.all('answer').length > before);
        const answer = this.host.last('answer');
        if (answer.status !== 0)
            throw new Error(`refused: ${JSON.stringify(this.host.all('refusal'))}`);
        return answer;
    }
}

/// With four cameras and an IMU at work; its options are 1 on SPI, 5 on I2C, 0 on SPI
/// without data-ready.
export function busy_rig(image, options, period) {
    const rig = new Rig(image, quick_usb);
    const imu = new Icm42688p(rig.machine, {
        select: options === 5 ? undefined : pin.spi_select,
        ready: pin.imu_ready,
        period,
    });
    [rig.camera] = [0, 1, 2, 3].map((output) => rig.add_camera(output));
    rig.connect();
    rig.configure({
        cameras: [0, 1, 2, 3].map(() => ({ latency: 8000 })),
        imus: [{ kind: 6, options, rate_mhz: 1_000_000 }],
    });
    rig.run_until('set up the IMU', () => rig.host.has_event(10));
    rig.host.start();
    imu.run(rig.machine.now + 125_000, rig.machine.now + 700 * period);
    return rig;
}
