// SPDX-License-Identifier: BSD-3-Clause
// SPI (PL022): frames that take their real time, FIFOs of eight, and models of devices at its pins.
// The levels of clock and data within a frame are not shown.
//
// spi.attach({ gpio, device }): `device` is selected while this GPIO is driven low. It has
//     exchange(word, { begin, end, bits }) => word, called at the end of each frame, and may have
//     select(is_selected, cycle).
// spi.on_frame = ({ begin, end, bits }) => ...: called at the begin of each frame.
// spi.hold(is_held): the clock stands still after the frame under way, or runs again.
// spi.exchange_as_master(word): for the slave mode; returns what the chip sends meanwhile.
import { fault, hex } from './fault.mjs';
import { pin_function, pins_that } from './pins.mjs';

const fifo_depth = 8;
// Where CPHA is 0, the chip raises its own select between words, which takes so many half periods.
const pause_half_periods = 3;
// An unread word raises the receive timeout after so many bits.
const timeout_bits = 32;

const interrupt = { overrun: 1, timeout: 2, receive: 4, transmit: 8 };

export class Spi {
    constructor({ name, number, clock, pins, interrupts, line, clocks }) {
        Object.assign(this, { name, clock, pins, interrupts, line, clocks });
        const pins_of = (role) =>
            pins_that((gpio) => ((gpio >>> 3) & 1) === number && (gpio & 3) === role);
        this.rx_pins = pins_of(0);
        this.clock_pins = pins_of(2);
        this.tx_pins = pins_of(3);
        this.devices = [];
        this.signal = () => {}; // (is_receive) to the DMA
        this.is_held = false;
        this.reset();
    }

    reset() {
        this.values = { 0x00: 0, 0x04: 0, 0x10: 0, 0x14: 0, 0x24: 0 };
        this.tx = [];
        this.rx = [];
        this.latched = 0; // overrun and timeout
        this.clock.cancel(this.event);
        this.clock.cancel(this.timeout);
        this.event = undefined;
        this.update_line();
        this.pins.drive();
    }

    attach({ gpio, device }) {
        const entry = { gpio, device, selected: false };
        this.devices.push(entry);
        this.pins.pad_listeners.push(() => this.look_at_select(entry));
    }

    look_at_select(entry) {
        const { pins } = this;
        const selected = ((pins.driven & ~pins.pad) >>> entry.gpio) & 1;
        if ((selected === 1) === entry.selected) return;
        entry.selected = selected === 1;
        entry.changed_at = this.clock.now;
        if (this.event !== undefined)
            fault(`${this.name}: GPIO ${entry.gpio}, a chip select, changes within a frame`);
        entry.device.select?.(entry.selected, this.clock.now);
    }

    get bits() {
        return (this.values[0x00] & 15) + 1;
    }
    get period() {
        return this.values[0x10] * (1 + ((this.values[0x00] >>> 8) & 0xff));
    }
    get is_enabled() {
        return (this.values[0x04] & 2) !== 0;
    }
    get is_slave() {
        return (this.values[0x04] & 4) !== 0;
    }

    wants_tx() {
        return (this.values[0x24] & 2) !== 0 && this.tx.length < fifo_depth;
    }
    wants_rx() {
        return (this.values[0x24] & 1) !== 0 && this.rx.length > 0;
    }

    begin_frame() {
        if (this.event !== undefined || this.tx.length === 0) return;
        if (!this.is_enabled || this.is_slave || this.is_held) return;
        this.check_clock();
        this.check_pins();
        const word = this.tx.shift();
        this.signal(false);
        const begin = this.clock.now;
        const { bits, period } = this;
        const end = begin + bits * period;
        this.event = this.clock.at(end, () => this.end_frame(word, { begin, end, bits }));
        this.on_frame?.({ begin, end, bits });
    }

    hold(is_held) {
        this.is_held = is_held;
        this.begin_frame();
    }

    check_clock() {
        const divider = this.values[0x10];
        if (divider < 2 || divider & 1) fault(`${this.name}: CPSR ${divider} is not even and >= 2`);
        if (!this.clocks.peri_runs) fault(`${this.name} is used, but clk_peri does not run`);
    }

    get loops() {
        return (this.values[0x04] & 1) !== 0;
    }

    check_pins() {
        if (this.loops || this.pins.is_driven(pin_function.spi, this.clock_pins)) return;
        fault(`${this.name} is used, but no pin has its clock`);
    }

    /// What the selected device answers, as far as there are pins for it.
    exchange(word, frame) {
        const { pins } = this;
        const sent = pins.is_driven(pin_function.spi, this.tx_pins) ? word : 0;
        let found = 0; // nobody drives the line
        for (const { device, selected } of this.devices)
            if (selected) found = device.exchange(sent, frame);
        return pins.is_read(pin_function.spi, this.rx_pins) ? found : 0;
    }

    end_frame(word, frame) {
        this.event = undefined;
        const mask = 2 ** frame.bits - 1;
        this.receive((this.loops ? word : this.exchange(word & mask, frame)) & mask);
        const pause = this.values[0x00] & 0x80 ? 0 : (pause_half_periods * this.period) / 2;
        if (this.tx.length > 0 && pause > 0) this.pause(pause);
        else this.begin_frame();
        this.update_line();
    }

    pause(cycles) {
        this.event = this.clock.after(cycles, () => {
            this.event = undefined;
            this.begin_frame();
            this.update_line();
        });
    }

    receive(word) {
        if (this.rx.length >= fifo_depth) this.latched |= interrupt.overrun;
        else this.rx.push(word);
        this.signal(true);
        this.clock.cancel(this.timeout);
        this.timeout = this.clock.after(timeout_bits * Math.max(this.period, 2), () => {
            if (this.rx.length > 0) this.latched |= interrupt.timeout;
            this.update_line();
        });
    }

    exchange_as_master(word) {
        if (!this.is_enabled || !this.is_slave) fault(`${this.name} is no enabled slave`);
        const sent = this.tx.shift() ?? 0;
        this.signal(false);
        this.receive(word & (2 ** this.bits - 1));
        this.update_line();
        return sent;
    }

    raw_interrupts() {
        const receive = this.rx.length >= fifo_depth / 2 ? interrupt.receive : 0;
        const transmit = this.tx.length <= fifo_depth / 2 ? interrupt.transmit : 0;
        return this.latched | receive | transmit;
    }

    update_line() {
        this.interrupts.set_line(this.line, (this.raw_interrupts() & this.values[0x14]) !== 0);
    }

    status() {
        const busy = this.event !== undefined || (this.tx.length > 0 && !this.is_slave);
        return (
            (this.tx.length === 0 ? 1 : 0) |
            (this.tx.length < fifo_depth ? 2 : 0) |
            (this.rx.length > 0 ? 4 : 0) |
            (this.rx.length >= fifo_depth ? 8 : 0) |
            (busy ? 16 : 0)
        );
    }

    read(offset) {
        if (offset in this.values) return this.values[offset];
        switch (offset) {
            case 0x08: {
                const word = this.rx.shift() ?? 0;
                this.update_line();
                return word;
            }
            case 0x0c:
                return this.status();
            case 0x18:
                return this.raw_interrupts();
            case 0x1c:
                return this.raw_interrupts() & this.values[0x14];
            case 0x20:
                return 0;
            default:
                return fault(`${this.name}'s register ${hex(offset)} is not modelled (read)`);
        }
    }

    write(offset, value, raw) {
        if (offset === 0x08) {
            if (this.tx.length < fifo_depth) this.tx.push(value & 0xffff);
            else fault(`${this.name}: a word is written into a full FIFO`);
            this.begin_frame();
        } else if (offset === 0x20) this.latched &= ~(raw & 3);
        else if (offset in this.values) this.write_value(offset, value);
        else fault(`${this.name}'s register ${hex(offset)} is not modelled (write)`);
        this.update_line();
    }

    write_value(offset, value) {
        const sets_format = offset === 0x00 || offset === 0x10;
        if (sets_format && this.event !== undefined) fault(`${this.name} is set up within a frame`);
        this.values[offset] = value;
        if (offset === 0x00 && value & 0x30)
            fault(`${this.name}: only Motorola frames are modelled`);
        if (offset <= 0x04) this.pins.drive();
        if (offset === 0x04) this.begin_frame();
        if (offset === 0x24) {
            this.signal(true);
            this.signal(false);
        }
    }
}

/// The pins of both blocks: clock, data and select, by the number of the GPIO.
export class SpiPins {
    constructor(spis) {
        this.spis = spis;
    }

    get enable() {
        return this.collect((spi) => (spi.is_slave ? 0 : 0b1110));
    }
    /// Idle levels: select high, the clock as CPOL says.
    get out() {
        return this.collect(({ values }) => 0b0010 | (values[0x00] & 0x40 ? 0b0100 : 0));
    }

    collect(levels) {
        let word = 0;
        for (let gpio = 0; gpio < 30; ++gpio) {
            const spi = this.spis[(gpio >>> 3) & 1];
            if ((levels(spi) >>> (gpio & 3)) & 1) word |= 1 << gpio;
        }
        return word;
    }
}
