// SPDX-License-Identifier: BSD-3-Clause
// UART (PL011): characters that take their real time, bit by bit at the transmitter's pin.
//
// uart.on_byte = (byte, cycle) => ...: what the chip sent, at the end of its stop bit.
// uart.send(bytes, at, baud): what somebody sends to it, from the cycle `at` on; at another speed
//     than the chip's, it sees framing errors.
import { fault, hex } from './fault.mjs';
import { pin_function, pins_that } from './pins.mjs';

const deep = 32;
// The receive timeout's interrupt comes after this many bits without a character.
const timeout_bits = 32;
// By how much the speeds may differ so that ten bits are still read right.
const tolerance = 0.04;
const clk_hz = 125_000_000;

const line = { fifo: 0x10, two_stops: 8, parity: 2 };
const interrupt = { receive: 0x10, transmit: 0x20, timeout: 0x40, framing: 0x80, overrun: 0x400 };
const framing_error = 0x100;
const overrun_error = 0x800;
const levels = [4, 8, 16, 24, 28];

/// Which of the two has this GPIO.
const uart_of = (gpio) => [0, 1, 1, 0, 0, 1, 1, 0][gpio >>> 2];

export class Uart {
    constructor({ name, number, clock, pins, interrupts, irq, clocks }) {
        Object.assign(this, { name, clock, pins, interrupts, irq, clocks });
        this.tx_pins = pins_that((gpio) => uart_of(gpio) === number && (gpio & 3) === 0);
        this.rx_pins = pins_that((gpio) => uart_of(gpio) === number && (gpio & 3) === 1);
        this.signal = () => {};
        this.on_byte = () => {};
        this.arrives_until = 0;
        this.reset();
    }

    reset() {
        this.values = {
            0x20: 0,
            0x24: 0,
            0x28: 0,
            0x2c: 0,
            0x30: 0x300,
            0x34: 0x12,
            0x38: 0,
            0x48: 0,
        };
        this.tx = [];
        this.rx = [];
        this.latched = 0;
        this.lost = false;
        this.has_sent = false;
        this.clock.cancel(this.event);
        this.clock.cancel(this.timeout);
        this.event = undefined;
        this.clock.cancel(this.next_bit);
        this.tx_level = true;
        this.update_line();
        this.pins.drive();
    }

    get depth() {
        return this.values[0x2c] & line.fifo ? deep : 1;
    }
    get bit_cycles() {
        const divider = this.values[0x24] + this.values[0x28] / 64;
        if (divider < 1) fault(`${this.name} is used without a speed`);
        if (!this.clocks.peri_runs) fault(`${this.name} is used, but clk_peri does not run`);
        return 16 * divider;
    }
    get frame_bits() {
        const control = this.values[0x2c];
        const data = 5 + ((control >>> 5) & 3);
        return 1 + data + (control & line.parity ? 1 : 0) + (control & line.two_stops ? 2 : 1);
    }

    wants_tx() {
        return (this.values[0x48] & 2) !== 0 && this.tx.length < this.depth;
    }
    wants_rx() {
        return (this.values[0x48] & 1) !== 0 && this.rx.length > 0;
    }

    begin() {
        if (this.event !== undefined || this.tx.length === 0) return;
        if ((this.values[0x30] & 0x101) !== 0x101) return;
        const byte = this.tx.shift();
        this.signal(false);
        this.send_bits(byte);
        const cycles = Math.round(this.frame_bits * this.bit_cycles);
        this.event = this.clock.after(cycles, () => {
            this.event = undefined;
            if (this.pins.is_driven(pin_function.uart, this.tx_pins))
                this.on_byte(byte, this.clock.now);
            this.begin();
            this.update_line();
        });
    }

    /// Start bit, data from the lowest bit on, stop bits; a parity bit is not modelled.
    send_bits(byte) {
        const begin = this.clock.now;
        const bits = (byte << 1) | 0xe00;
        const show = (number) => {
            this.tx_level = ((bits >>> number) & 1) !== 0;
            this.pins.drive();
            let next = number + 1;
            while (next < 10 && ((bits >>> next) & 1) === ((bits >>> number) & 1)) ++next;
            this.next_bit =
                next === 10
                    ? undefined
                    : this.clock.at(begin + Math.round(next * this.bit_cycles), () => show(next));
        };
        show(0);
    }

    send(bytes, at = this.clock.now, baud = undefined) {
        const copy = Uint8Array.from(bytes);
        this.clock.at(Math.max(at, this.clock.now), () => {
            for (const byte of copy) this.send_byte(byte, baud);
        });
    }

    send_byte(byte, baud) {
        const own = this.bit_cycles;
        const bit = baud === undefined ? own : clk_hz / baud;
        const begin = Math.max(this.arrives_until, this.clock.now);
        this.arrives_until = begin + Math.round(bit * this.frame_bits);
        const wrong = Math.abs(bit / own - 1) > tolerance;
        this.clock.at(this.arrives_until, () => this.receive(wrong ? framing_error : byte));
    }

    receive(character) {
        if ((this.values[0x30] & 0x201) !== 0x201) return;
        if (!this.pins.is_read(pin_function.uart, this.rx_pins)) return;
        if (character & framing_error) this.latched |= interrupt.framing;
        if (this.rx.length >= this.depth) {
            this.lost = true;
            this.latched |= interrupt.overrun;
        } else {
            this.rx.push(character | (this.lost ? overrun_error : 0));
            this.lost = false;
        }
        this.signal(true);
        this.restart_timeout();
        this.update_line();
    }

    restart_timeout() {
        this.clock.cancel(this.timeout);
        this.timeout = this.clock.after(Math.round(timeout_bits * this.bit_cycles), () => {
            if (this.rx.length > 0) this.latched |= interrupt.timeout;
            this.update_line();
        });
    }

    level(shift) {
        const fifo = this.values[0x2c] & line.fifo;
        return fifo ? (levels[(this.values[0x34] >>> shift) & 7] ?? deep) : 1;
    }

    raw_interrupts() {
        const receive = this.rx.length >= this.level(3) ? interrupt.receive : 0;
        const few = this.depth === 1 ? this.tx.length === 0 : this.tx.length <= this.level(0);
        return this.latched | receive | (few && this.has_sent ? interrupt.transmit : 0);
    }

    update_line() {
        this.interrupts.set_line(this.irq, (this.raw_interrupts() & this.values[0x38]) !== 0);
    }

    flags() {
        const { tx, rx, depth } = this;
        const busy = this.event !== undefined || tx.length > 0;
        return (
            (busy ? 0x08 : 0) |
            (rx.length === 0 ? 0x10 : 0) |
            (tx.length >= depth ? 0x20 : 0) |
            (rx.length >= depth ? 0x40 : 0) |
            (tx.length === 0 ? 0x80 : 0)
        );
    }

    read(offset) {
        if (offset in this.values) return this.values[offset];
        switch (offset) {
            case 0x00: {
                const character = this.rx.shift() ?? 0;
                if (this.rx.length === 0) this.latched &= ~interrupt.timeout;
                this.update_line();
                return character;
            }
            case 0x04:
            case 0x44:
                return 0;
            case 0x18:
                return this.flags();
            case 0x3c:
                return this.raw_interrupts();
            case 0x40:
                return this.raw_interrupts() & this.values[0x38];
            default:
                return fault(`${this.name}'s register ${hex(offset)} is not modelled (read)`);
        }
    }

    write(offset, value, raw) {
        if (offset === 0x00) this.put(value & 0xff);
        else if (offset === 0x44) this.latched &= ~raw;
        else if (offset in this.values) {
            this.values[offset] = value;
            if (offset === 0x30) {
                this.pins.drive();
                this.begin();
            }
            if (offset === 0x48) {
                this.signal(true);
                this.signal(false);
            }
        } else if (offset !== 0x04)
            fault(`${this.name}'s register ${hex(offset)} is not modelled (write)`);
        this.update_line();
    }

    put(byte) {
        if (this.tx.length >= this.depth) fault(`${this.name}: a byte is written into a full FIFO`);
        this.tx.push(byte);
        this.has_sent = true;
        this.begin();
    }
}

/// The pins of both blocks: only the transmitters drive, and idle high.
export class UartPins {
    constructor(uarts) {
        this.uarts = uarts;
    }

    get out() {
        return this.uarts.reduce((all, uart) => (uart.tx_level ? all | uart.tx_pins : all), 0);
    }

    get enable() {
        return pins_that(
            (gpio) => (gpio & 3) === 0 && (this.uarts[uart_of(gpio)].values[0x30] & 1) !== 0,
        );
    }
}
