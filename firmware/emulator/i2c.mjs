// SPDX-License-Identifier: BSD-3-Clause
// I2C (DW_apb_i2c) as a master: bytes that take their real time, and models of devices. The levels
// of its lines are not shown.
//
// i2c.attach(address, device): `device` has start(is_read, cycle) => acknowledges,
//     write(byte, cycle) => acknowledges, read(cycle) => byte, and may have stop(cycle). Where no
//     device is, the address is not acknowledged.
// i2c.hold(is_held): somebody holds the bus after the byte under way, or releases it.
import { fault, hex } from './fault.mjs';
import { pin_function, pins_that } from './pins.mjs';

const fifo_depth = 16;

const is_read_command = 0x100;
const ends_with_stop = 0x200;
const begins_with_restart = 0x400;

const interrupt = {
    rx_under: 1 << 0,
    rx_over: 1 << 1,
    rx_full: 1 << 2,
    tx_over: 1 << 3,
    tx_empty: 1 << 4,
    read_request: 1 << 5,
    tx_abort: 1 << 6,
    rx_done: 1 << 7,
    activity: 1 << 8,
    stop: 1 << 9,
    start: 1 << 10,
    general_call: 1 << 11,
    restart: 1 << 12,
};
const abort_no_address = 1 << 0;
const abort_no_data = 1 << 3;

// The chip adds this many cycles to the counts of each half period.
const high_extra = 8;
const low_extra = 1;
const bits_per_byte = 9; // with the acknowledgement

const defaults = {
    0x00: 0x65,
    0x04: 0x55,
    0x08: 0x55,
    0x14: 0x28,
    0x18: 0x2f,
    0x1c: 0x06,
    0x20: 0x0d,
    0x30: 0x8ff,
    0x38: 0,
    0x3c: 0,
    0x6c: 0,
    0x7c: 1,
    0x84: 0,
    0x88: 0,
    0x8c: 0,
    0x90: 0,
    0x94: 0x64,
    0x98: 1,
    0xa0: 7,
};
// Reading one of these clears a bit.
const clearing = {
    0x44: interrupt.rx_under,
    0x48: interrupt.rx_over,
    0x4c: interrupt.tx_over,
    0x50: interrupt.read_request,
    0x54: interrupt.tx_abort,
    0x58: interrupt.rx_done,
    0x5c: interrupt.activity,
    0x60: interrupt.stop,
    0x64: interrupt.start,
    0x68: interrupt.general_call,
    0xa8: interrupt.restart,
};

export class I2c {
    constructor({ name, number, clock, pins, interrupts, line }) {
        Object.assign(this, { name, clock, pins, interrupts, line });
        this.own_pins = [0, 1].map((role) =>
            pins_that((gpio) => ((gpio >>> 1) & 1) === number && (gpio & 1) === role),
        );
        this.devices = new Map();
        this.is_held = false;
        this.signal = () => {};
        this.reset();
    }

    reset() {
        this.values = { ...defaults };
        this.tx = [];
        this.rx = [];
        this.latched = 0;
        this.abort_source = 0;
        this.direction = undefined; // of the transfer under way: true is reading
        this.device = undefined;
        this.clock.cancel(this.event);
        this.event = undefined;
        this.update_line();
    }

    attach(address, device) {
        this.devices.set(address, device);
    }

    hold(is_held) {
        this.is_held = is_held;
        this.advance();
    }

    get is_enabled() {
        return (this.values[0x6c] & 1) !== 0;
    }

    get bit_cycles() {
        const is_fast = ((this.values[0x00] >>> 1) & 3) >= 2;
        const high = this.values[is_fast ? 0x1c : 0x14];
        const low = this.values[is_fast ? 0x20 : 0x18];
        return high + high_extra + low + low_extra;
    }

    wants_tx() {
        return (this.values[0x88] & 2) !== 0 && this.tx.length <= this.values[0x8c];
    }
    wants_rx() {
        return (this.values[0x88] & 1) !== 0 && this.rx.length > this.values[0x90];
    }

    /// Takes the next command, unless one is under way.
    advance() {
        if (this.event !== undefined || this.tx.length === 0 || !this.is_enabled) return;
        if (this.is_held) return;
        if (!this.own_pins.every((pins) => this.pins.is_read(pin_function.i2c, pins)))
            fault(`${this.name} is used, but no pins have its data and clock`);
        const command = this.tx.shift();
        this.signal(false);
        const is_read = (command & is_read_command) !== 0;
        const starts = this.direction !== is_read || (command & begins_with_restart) !== 0;
        if (starts) this.after_bits(bits_per_byte + 1, () => this.address(is_read, command));
        else this.transfer(command);
    }

    after_bits(bits, action) {
        this.event = this.clock.after(bits * this.bit_cycles, () => {
            this.event = undefined;
            action();
            this.update_line();
        });
    }

    address(is_read, command) {
        this.device = this.devices.get(this.values[0x04] & 0x7f);
        this.latched |= interrupt.start | interrupt.activity;
        if (!this.device?.start(is_read, this.clock.now)) return this.abort(abort_no_address);
        this.direction = is_read;
        this.transfer(command);
    }

    transfer(command) {
        this.after_bits(bits_per_byte, () => {
            const { now } = this.clock;
            if (command & is_read_command) this.receive(this.device.read(now) & 0xff);
            else if (!this.device.write(command & 0xff, now)) return this.abort(abort_no_data);
            if (command & ends_with_stop) this.stop();
            else this.advance();
        });
    }

    receive(byte) {
        if (this.rx.length >= fifo_depth) this.latched |= interrupt.rx_over;
        else this.rx.push(byte);
        this.signal(true);
    }

    stop() {
        this.after_bits(1, () => {
            this.device?.stop?.(this.clock.now);
            this.direction = undefined;
            this.latched |= interrupt.stop;
            this.advance();
        });
    }

    abort(source) {
        this.abort_source = source;
        this.latched |= interrupt.tx_abort;
        this.tx = [];
        this.stop();
    }

    raw_interrupts() {
        const { tx, rx, values } = this;
        const full = rx.length > values[0x38] ? interrupt.rx_full : 0;
        const empty = tx.length <= values[0x3c] ? interrupt.tx_empty : 0;
        return this.latched | full | (this.is_enabled ? empty : 0);
    }

    update_line() {
        this.interrupts.set_line(this.line, (this.raw_interrupts() & this.values[0x30]) !== 0);
    }

    status() {
        const { tx, rx } = this;
        const active = this.event !== undefined || this.direction !== undefined;
        return (
            (active ? 0x21 : 0) |
            (tx.length < fifo_depth ? 2 : 0) |
            (tx.length === 0 ? 4 : 0) |
            (rx.length > 0 ? 8 : 0) |
            (rx.length >= fifo_depth ? 16 : 0)
        );
    }

    read(offset) {
        if (offset in this.values) return this.values[offset];
        const value = this.read_changing(offset);
        this.update_line();
        return value;
    }

    read_changing(offset) {
        if (offset in clearing) return this.clear(clearing[offset]);
        switch (offset) {
            case 0x10:
                return this.rx.shift() ?? this.read_nothing();
            case 0x2c:
                return this.raw_interrupts() & this.values[0x30];
            case 0x34:
                return this.raw_interrupts();
            case 0x40:
                return this.clear(0xfff);
            case 0x70:
                return this.status();
            case 0x74:
                return this.tx.length;
            case 0x78:
                return this.rx.length;
            case 0x80:
                return this.abort_source;
            case 0x9c:
                return this.is_enabled ? 1 : 0;
            case 0xf4:
                return 0;
            case 0xf8:
                return 0x3230312a;
            case 0xfc:
                return 0x44570140;
            default:
                return fault(`${this.name}'s register ${hex(offset)} is not modelled (read)`);
        }
    }

    read_nothing() {
        this.latched |= interrupt.rx_under;
        return 0;
    }

    clear(bits) {
        const found = this.latched & bits ? 1 : 0;
        this.latched &= ~bits;
        if (bits & interrupt.tx_abort) this.abort_source = 0;
        return found;
    }

    write(offset, value) {
        if (offset === 0x10) this.put(value & 0x7ff);
        else if (offset in this.values) this.write_value(offset, value);
        else fault(`${this.name}'s register ${hex(offset)} is not modelled (write)`);
        this.update_line();
    }

    put(command) {
        if (!this.is_enabled) fault(`${this.name} is used while it is disabled`);
        if (this.tx.length >= fifo_depth)
            fault(`${this.name}: a command is written into a full FIFO`);
        if (this.abort_source !== 0) return; // flushed until the abort is cleared
        this.tx.push(command);
        this.advance();
    }

    write_value(offset, value) {
        const sets_up = offset <= 0x04 || (offset >= 0x14 && offset <= 0x20);
        if (sets_up && this.is_enabled)
            fault(`${this.name}'s register ${hex(offset)} is written while it is enabled`);
        if (offset === 0x00 && (value & 0x41) !== 0x41)
            fault(`${this.name}: only a master is modelled`);
        this.values[offset] = value;
        if (offset === 0x6c && !(value & 1)) {
            this.tx = [];
            this.rx = [];
        }
        if (offset === 0x88) {
            this.signal(true);
            this.signal(false);
        }
    }
}

/// The pins: open drain, high while nothing is seen.
export const i2c_pins = { out: 0, enable: 0 };
