// SPDX-License-Identifier: BSD-3-Clause
// Watchdog and the tick that it makes for the timer. Erratum RP2040-E1: it counts down twice per
// tick.
import { fault, hex } from './fault.mjs';

const cycles_per_count = 62.5; // at the right tick of 1 us
const count_mask = 0xffffff;
const crystal_mhz = 12;
const enable_bit = 1 << 30;
const trigger_bit = 1 << 31;
const scratch_count = 8;

export class Watchdog {
    /// `reason` and `scratch` are what the last run left. `on_bite(forced)` is called at a reset.
    constructor(clock, clocks, { reason = 0, scratch = [] } = {}) {
        this.clock = clock;
        this.clocks = clocks;
        this.reason = reason;
        this.scratch = Array.from({ length: scratch_count }, (_, i) => scratch[i] ?? 0);
        this.control = 0x07000000;
        this.tick_control = 0x200;
        this.loaded = 0;
        this.loaded_at = 0;
        this.event = undefined;
        this.on_tick = () => {};
        this.on_bite = () => {};
    }

    /// Whether the timer's tick runs; with any other rate than 1 MHz the times here are wrong.
    get runs() {
        if (!(this.tick_control & 0x200)) return false;
        const cycles = this.tick_control & 0x1ff;
        if (cycles === 0) return false;
        if (cycles !== crystal_mhz || !this.clocks.ref_is_crystal)
            fault(`the tick is not 1 MHz: ${cycles} cycles, and clk_ref must be the crystal`);
        return true;
    }

    get count() {
        if (!(this.control & enable_bit)) return this.loaded;
        const passed = Math.floor((this.clock.now - this.loaded_at) / cycles_per_count);
        return Math.max(0, this.loaded - passed);
    }

    read(offset) {
        if (offset >= 0x0c && offset < 0x2c) return this.scratch[(offset - 0x0c) >>> 2];
        switch (offset) {
            case 0x00:
                return (this.control | this.count) >>> 0;
            case 0x08:
                return this.reason;
            case 0x2c:
                return this.tick_control | (this.tick_control > 0x200 ? 0x400 : 0);
            default:
                return fault(`WATCHDOG's register ${hex(offset)} cannot be read`);
        }
    }

    write(offset, value) {
        if (offset >= 0x0c && offset < 0x2c) {
            this.scratch[(offset - 0x0c) >>> 2] = value;
            return;
        }
        switch (offset) {
            case 0x00:
                return this.write_control(value);
            case 0x04:
                this.loaded = value & count_mask;
                return this.schedule();
            case 0x2c:
                this.tick_control = value & 0x3ff;
                return this.on_tick();
            default:
                fault(`WATCHDOG's register ${hex(offset)} cannot be written`);
        }
    }

    write_control(value) {
        if (value & trigger_bit) return this.bite(true);
        const { count } = this;
        this.control = value & 0x47000000;
        this.loaded = count;
        this.schedule();
    }

    schedule() {
        this.clock.cancel(this.event);
        this.loaded_at = this.clock.now;
        if (!(this.control & enable_bit)) return;
        if (!this.runs) return;
        const cycles = Math.ceil(this.loaded * cycles_per_count);
        this.event = this.clock.after(cycles, () => this.bite(false));
    }

    /// What is left when the boot loader, which was called with two words, has started the chip again:
    /// it comes and goes by the watchdog, and finds these words in the first two scratch registers
    /// (raspberrypi/pico-bootrom-rp2040, reset_usb_boot).
    restart_into_boot_loader(given) {
        given.forEach((word, at) => (this.scratch[at] = word));
        this.scratch[4] = 0;
        this.reason = 1;
    }

    bite(forced) {
        this.reason = forced ? 2 : 1;
        this.on_bite(forced);
    }
}
