// SPDX-License-Identifier: BSD-3-Clause
// The GPIO: who drives a pin, what the pads make of it, and what comes back in. Levels are words
// with a bit per GPIO. An output changes at the end of the cycle in which its driver acts.
import { fault, hex } from './fault.mjs';
import { irq } from './interrupts.mjs';
import { PinPath } from './pin_path.mjs';

export const pin_count = 30;
const all_pins = 2 ** pin_count - 1;

// PIO and SIO see an input this many cycles after it changed.
const synchroniser_cycles = 2;

// Pads after reset: input on, pull-down, 4 mA, Schmitt trigger.
const pad_default = 0x56;
const debug_pad_defaults = [0xda, 0x5a];
const pad_output_disable = 0x80;
const pad_input_enable = 0x40;
const pad_pull_up = 0x08;
const pad_pull_down = 0x04;

const function_null = 31;
export const pin_function = { spi: 1, uart: 2, i2c: 3, pwm: 4, sio: 5, pio0: 6, pio1: 7 };

// Number of remembered changes of the inputs. The readers look back two cycles; a state machine
// whose loop was skipped looks back one iteration, over pins that did not change meanwhile.
const history_size = 16;

// GPIO29 of a Pico measures its supply: a divider with a capacitor.
const capacitor = { gpio: 29, shortest_ns: 100_000 };

/// Words that say which pins a two-bit override changes, and how.
class Override {
    constructor() {
        this.invert = 0;
        this.low = 0;
        this.high = 0;
    }

    set(bit, kind) {
        for (const name of ['invert', 'low', 'high']) this[name] &= ~bit;
        if (kind === 1) this.invert |= bit;
        if (kind === 2) this.low |= bit;
        if (kind === 3) this.high |= bit;
    }

    apply(word) {
        return ((word ^ this.invert) & ~this.low) | this.high;
    }
}

export class Pins {
    constructor(clock, interrupts) {
        this.clock = clock;
        this.interrupts = interrupts;
        this.sources = new Map(); // by function: objects with `out` and `enable`
        this.listeners = []; // of inputs: (changed, time)
        this.pad_listeners = []; // of levels and drivers
        this.watched = 0;
        this.log = [];
        this.external = 0;
        this.externally_driven = 0;
        this.out = 0; // as driven, before the pads
        this.driven = 0;
        this.pad = 0; // the levels at the pins
        this.paths = new Map(); // by GPIO; the others are ideal
        this.times = new Float64Array(history_size);
        this.words = new Uint32Array(history_size); // inputs before each of `times`
        this.newest = 0;
        this.inputs = 0;
        this.reset_pads();
        this.reset_io();
        const { gpio, ...load } = capacitor;
        this.set_path(gpio, load);
    }

    reset_pads() {
        this.pads = new Uint8Array(pin_count + 2).fill(pad_default);
        this.pads.set(debug_pad_defaults, pin_count);
        this.voltage = 0;
        this.output_disable = 0;
        this.input_enable = all_pins;
        this.pull_up = 0;
        this.pull_down = all_pins;
        if (this.selected !== undefined) this.drive();
    }

    reset_io() {
        this.controls = new Uint32Array(pin_count).fill(function_null);
        this.selected = new Map([...this.sources.keys()].map((name) => [name, 0]));
        this.out_override = new Override();
        this.enable_override = new Override();
        this.in_override = new Override();
        this.irq_override = new Override();
        this.raised = new Uint8Array(32); // edges seen, per GPIO: bit 2 fall, bit 3 rise
        this.irq_enable = new Uint8Array(32);
        this.irq_force = new Uint8Array(32);
        this.irq_pins = 0; // pins that can interrupt
        this.sources_by_order = [];
        this.drive();
    }

    /// `source` has `out` and `enable`, words with the signals at their pins. It calls `drive`
    /// after it changed them.
    add_source(number, source) {
        this.sources.set(number, source);
        this.selected.set(number, 0);
    }

    select(gpio, number) {
        const bit = 1 << gpio;
        for (const [name, pins] of this.selected)
            this.selected.set(name, name === number ? pins | bit : pins & ~bit);
        if (number !== function_null && !this.sources.has(number))
            fault(`GPIO ${gpio} is given to function ${number}, which is not modelled`);
        this.sources_by_order = [...this.selected]
            .filter(([, pins]) => pins !== 0)
            .map(([name, pins]) => ({ source: this.sources.get(name), pins }));
    }

    /// Whether a block that is function `number` reads one of the pins of `mask`.
    is_read(number, mask) {
        return (this.selected.get(number) & this.input_enable & mask) !== 0;
    }

    /// Whether it drives one of them.
    is_driven(number, mask) {
        return (this.selected.get(number) & ~this.output_disable & mask) !== 0;
    }

    /// Recomputes the levels after a source, a pad or a multiplexer changed. They hold from the end
    /// of this cycle.
    drive() {
        let out = 0;
        let enable = 0;
        for (const { source, pins } of this.sources_by_order) {
            out |= source.out & pins;
            enable |= source.enable & pins;
        }
        out = this.out_override.apply(out);
        enable = this.enable_override.apply(enable) & ~this.output_disable & all_pins;
        this.set_levels(out, enable, this.clock.now + 1);
    }

    set_levels(out, driven, time) {
        const floating = this.pull_up & ~this.externally_driven;
        const wanted =
            ((out & driven) | (~driven & ((this.external & this.externally_driven) | floating))) &
            all_pins;
        const pad = this.behind_paths(wanted, time);
        const changed = (pad ^ this.pad) | (driven ^ this.driven);
        this.out = out;
        this.driven = driven;
        this.pad = pad;
        if (changed & this.watched) this.note(time - 1);
        if (changed !== 0) for (const listener of this.pad_listeners) listener();
        const inputs = this.in_override.apply(pad & this.input_enable) & all_pins;
        if (inputs !== this.inputs) this.set_inputs(inputs, time);
    }

    /// What lies between the GPIO and whoever drives it (pin_path.mjs); without `properties`,
    /// nothing. Returns the path.
    set_path(gpio, properties) {
        this.paths.get(gpio)?.cut();
        this.paths.delete(gpio);
        if (properties !== undefined) {
            const level = (this.pad >>> gpio) & 1;
            const moved = () => this.set_levels(this.out, this.driven, this.clock.now);
            this.paths.set(gpio, new PinPath(this.clock, properties, level, moved));
        }
        this.set_levels(this.out, this.driven, this.clock.now);
        return this.paths.get(gpio);
    }

    behind_paths(wanted, time) {
        let pad = wanted;
        for (const [gpio, path] of this.paths) {
            const bit = 1 << gpio;
            path.drive((wanted >>> gpio) & 1, time);
            pad = path.level ? pad | bit : pad & ~bit;
        }
        return pad;
    }

    note(cycle) {
        const entry = { cycle, levels: this.pad >>> 0, driven: this.driven >>> 0 };
        const last = this.log[this.log.length - 1];
        if (last !== undefined && last.cycle === cycle) this.log[this.log.length - 1] = entry;
        else this.log.push(entry);
        this.on_output?.(entry);
    }

    set_inputs(inputs, time) {
        const changed = inputs ^ this.inputs;
        const { times, words } = this;
        if (times[this.newest] !== time) {
            this.newest = (this.newest + 1) % history_size;
            times[this.newest] = time;
            words[this.newest] = this.inputs;
        }
        this.inputs = inputs;
        this.raise(changed, time);
        for (const listener of this.listeners) listener(changed, time);
    }

    /// What is at the pins' inputs at the begin of `cycle`, without a synchroniser.
    inputs_at(cycle) {
        const { times, words, newest } = this;
        let word = this.inputs;
        for (let i = 0; i < history_size; ++i) {
            const at = (newest - i + history_size) % history_size;
            if (times[at] <= cycle) break;
            word = words[at];
        }
        return word;
    }

    synchronised(cycle) {
        return this.inputs_at(cycle - synchroniser_cycles);
    }

    /// Whether the inputs of `mask` have not changed since the cycle `since`.
    is_steady(mask, since) {
        const { times, words, newest } = this;
        for (let i = 0; i < history_size; ++i) {
            const at = (newest - i + history_size) % history_size;
            if (times[at] <= since) return true;
            if ((words[at] ^ this.inputs) & mask) return false;
        }
        return true;
    }

    /// A level from outside; undefined: nothing drives the pin. `at` may lie within this cycle.
    set_external(gpio, level, at = this.clock.now) {
        if (!Number.isInteger(at) && !this.paths.has(gpio)) this.set_path(gpio, {});
        const bit = 1 << gpio;
        this.externally_driven =
            level === undefined ? this.externally_driven & ~bit : this.externally_driven | bit;
        this.external = level ? this.external | bit : this.external & ~bit;
        this.set_levels(this.out, this.driven, at);
    }

    // Interrupts of the GPIO.

    /// Inputs before INOVER are what interrupts see.
    irq_level() {
        return this.irq_override.apply(this.pad & this.input_enable);
    }

    raise(changed, time) {
        const level = this.irq_level();
        for (let left = changed & all_pins; left !== 0; left &= left - 1) {
            const gpio = 31 - Math.clz32(left & -left);
            this.raised[gpio] |= (level >>> gpio) & 1 ? 8 : 4;
        }
        if (changed & this.irq_pins)
            this.clock.at(time + synchroniser_cycles, () => this.update_line());
    }

    status_of(gpio) {
        const high = (this.irq_level() >>> gpio) & 1;
        return this.raised[gpio] | (high ? 2 : 1);
    }

    update_line() {
        let level = false;
        for (let gpio = 0; gpio < pin_count && !level; ++gpio)
            level = ((this.irq_enable[gpio] & this.status_of(gpio)) | this.irq_force[gpio]) !== 0;
        this.interrupts.set_line(irq.io_bank0, level);
    }

    read_io(offset) {
        if (offset < 8 * pin_count) {
            const gpio = offset >>> 3;
            return offset & 4 ? this.controls[gpio] : this.read_status(gpio);
        }
        const read = {
            0xf0: (gpio) => this.status_of(gpio),
            0x100: (gpio) => this.irq_enable[gpio],
            0x110: (gpio) => this.irq_force[gpio],
            0x120: (gpio) => (this.irq_enable[gpio] & this.status_of(gpio)) | this.irq_force[gpio],
        }[offset & ~0xf];
        if (read === undefined) return fault(`IO_BANK0's register ${hex(offset)} is not modelled`);
        return this.eight_pins(offset, read);
    }

    eight_pins(offset, read) {
        const first = 2 * (offset & 0xf);
        let value = 0;
        for (let i = 0; i < 8 && first + i < pin_count; ++i) value |= read(first + i) << (4 * i);
        return value >>> 0;
    }

    read_status(gpio) {
        const at = (word, position) => ((word >>> gpio) & 1) << position;
        return (
            at(this.out, 9) |
            at(this.driven, 13) |
            at(this.pad & this.input_enable, 17) |
            at(this.inputs, 19) |
            at(this.irq_level(), 24) |
            at(this.irq_level(), 26)
        );
    }

    write_io(offset, value, raw) {
        if (offset < 8 * pin_count) {
            this.write_control(offset >>> 3, value);
            return;
        }
        if (offset >= 0x120) fault(`IO_BANK0's register ${hex(offset)} is not modelled (write)`);
        const first = 2 * (offset & 0xf);
        for (let i = 0; i < 8 && first + i < pin_count; ++i) {
            const gpio = first + i;
            if ((offset & ~0xf) === 0xf0) this.raised[gpio] &= ~((raw >>> (4 * i)) & 0xc);
            if ((offset & ~0xf) === 0x100) this.irq_enable[gpio] = (value >>> (4 * i)) & 0xf;
            if ((offset & ~0xf) === 0x110) this.irq_force[gpio] = (value >>> (4 * i)) & 0xf;
        }
        this.irq_pins = this.irq_enable.reduce(
            (pins, enabled, gpio) => (enabled ? pins | (1 << gpio) : pins),
            0,
        );
        this.update_line();
    }

    write_control(gpio, value) {
        const bit = 1 << gpio;
        this.controls[gpio] = value;
        this.out_override.set(bit, (value >>> 8) & 3);
        this.enable_override.set(bit, (value >>> 12) & 3);
        this.in_override.set(bit, (value >>> 16) & 3);
        this.irq_override.set(bit, (value >>> 28) & 3);
        this.select(gpio, value & 0x1f);
        this.drive();
    }

    read_pads(offset) {
        if (offset === 0) return this.voltage;
        return this.pads[offset / 4 - 1];
    }

    write_pads(offset, value) {
        if (offset === 0) this.voltage = value & 1;
        if (offset === 0) return;
        const gpio = offset / 4 - 1;
        this.pads[gpio] = value;
        if (gpio >= pin_count) return; // the pins of the debugger
        const bit = 1 << gpio;
        const set = (word, flag) => (value & flag ? word | bit : word & ~bit);
        this.output_disable = set(this.output_disable, pad_output_disable);
        this.input_enable = set(this.input_enable, pad_input_enable);
        this.pull_up = set(this.pull_up, pad_pull_up);
        this.pull_down = set(this.pull_down, pad_pull_down);
        this.drive();
    }
}

/// A word with a bit for each GPIO for which `belongs` holds.
export function pins_that(belongs) {
    let word = 0;
    for (let gpio = 0; gpio < pin_count; ++gpio) if (belongs(gpio)) word |= 1 << gpio;
    return word;
}

/// The two blocks of registers.
export const io_block = (pins) => ({
    read: (offset) => pins.read_io(offset),
    write: (offset, value, raw) => pins.write_io(offset, value, raw),
    reset: () => pins.reset_io(),
});
export const pads_block = (pins) => ({
    read: (offset) => pins.read_pads(offset),
    write: (offset, value) => pins.write_pads(offset, value),
    reset: () => pins.reset_pads(),
});
