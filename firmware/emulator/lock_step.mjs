// SPDX-License-Identifier: BSD-3-Clause
// The emulated board in the time that another process gives it:
//
//   node lock_step.mjs IMAGE '{"watch": [GPIO...], "selects": [GPIO...], "i2c": [ADDRESS...]}'
//
// An object of JSON per line. Standard input has commands, each answered by one line when it is
// done; all instants are cycles since the board's time began.
//
//   {"until": CYCLE, "inputs": [[GPIO, LEVEL, CYCLE]...], "usb": [[HEX, CYCLE]...],
//    "uart": [[HEX, CYCLE OF ITS END]...], "reads": does the host, "held": is the SPI bus,
//    "i2c_held": is the I2C bus}
//   -> {"now": CYCLE, "pins": [[CYCLE, LEVELS OF ALL GPIO]...], "usb": [[CYCLE, HEX]...],
//       "uart": [HEX, BAUD], "stopped": nothing or what stopped it}
// runs to that cycle, or right after the first change of a GPIO of `watch`.
//
//   {"start": true} -> {"now": CYCLE}
// starts it, or once more as after the reset that stopped it, until a USB host has set it up.
//
// When a byte was sent to the part that one of `selects` selects,
//   {"transfer": {"at": CYCLE, "select": INDEX, "hz": CLOCK, "bytes": HEX}}
// asks what it answers: {"bytes": HEX}.
//
// For each byte to or from the register of a part at one of the addresses `i2c`,
//   {"transfer": {"at": CYCLE, "address": ADDRESS, "reads": does the chip, "hz": CLOCK,
//                 "bytes": HEX of the register, and of the byte}}
// asks the same as if it were a transfer of its own, begun at `at`: {"bytes": HEX,
// "acknowledged": is it}; without a byte, whether the part is there.
import { readFileSync, readSync, writeSync } from 'node:fs';
import { ram_begin } from './chip.mjs';
import { Fault, fault } from './fault.mjs';
import { Machine } from './machine.mjs';

const clk_hz = 125_000_000;
const spi0_transmits = 16; // the DMA's request

const first = {
    flash: readFileSync(process.argv[2]),
    ram_only: true,
    usb_times: { debounce_ms: 1, reset_ms: 1, recovery_ms: 1 },
};

const from_hex = (text) => Uint8Array.from(Buffer.from(text, 'hex'));
const to_hex = (bytes) => Buffer.from(bytes).toString('hex');

class Lines {
    constructor() {
        this.chunk = Buffer.alloc(1 << 16);
        this.text = '';
    }

    /// undefined at the end of the input.
    read() {
        for (;;) {
            const end = this.text.indexOf('\n');
            if (end >= 0) {
                const line = this.text.slice(0, end);
                this.text = this.text.slice(end + 1);
                return JSON.parse(line);
            }
            const size = readSync(0, this.chunk);
            if (size === 0) return undefined;
            this.text += this.chunk.latin1Slice(0, size);
        }
    }

    write(object) {
        const bytes = Buffer.from(`${JSON.stringify(object)}\n`);
        for (let sent = 0; sent < bytes.length; ) sent += writeSync(1, bytes, sent);
    }
}

/// An SPI part of the other process. It wants all bytes of a selection at once: what the chip is
/// about to send stands where its DMA will read it.
class DistantPart {
    constructor(board, index) {
        Object.assign(this, { board, index });
    }

    select(is_selected, cycle) {
        if (!is_selected) return;
        const { machine } = this.board;
        const channel = machine.dma.channels.find(({ request }) => request === spi0_transmits);
        const begin = channel.read - ram_begin;
        this.sent = machine.bus.ram.slice(begin, begin + channel.reload);
        this.begun = cycle;
        this.position = 0;
    }

    exchange(word) {
        // Not sooner: where the clock stands still, nothing reaches the part.
        if (this.position === 0) this.ask();
        if (word !== this.sent[this.position])
            fault(`byte ${this.position} of an SPI transfer is not what was announced`);
        return this.answer[this.position++];
    }

    ask() {
        const { machine, lines, zero } = this.board;
        const hz = Math.round(clk_hz / machine.spi[0].period);
        const at = this.begun - zero;
        lines.write({ transfer: { at, select: this.index, hz, bytes: to_hex(this.sent) } });
        this.answer = from_hex(lines.read().bytes);
    }
}

/// An I2C part of the other process, whose register addresses count up.
class DistantRegisters {
    constructor(board, address) {
        Object.assign(this, { board, address });
    }

    start(is_read, cycle) {
        if (!is_read) this.register = undefined;
        return this.ask(is_read, cycle, [this.register ?? 0]).acknowledged;
    }

    write(byte, cycle) {
        if (this.register === undefined) {
            this.register = byte;
            return true;
        }
        const before = 2; // the address, the register
        return this.ask(false, this.begin(cycle, before), [this.register++, byte]).acknowledged;
    }

    read(cycle) {
        const before = 3; // the address, the register, the address once more
        const { bytes } = this.ask(true, this.begin(cycle, before), [this.register++, 0]);
        return from_hex(bytes)[1];
    }

    /// Of a transfer in which a byte that has just ended comes after others.
    begin(cycle, before) {
        return cycle - (before + 1) * 9 * this.board.machine.i2c[1].bit_cycles;
    }

    ask(reads, cycle, bytes) {
        const { machine, lines, zero } = this.board;
        const hz = Math.round(clk_hz / machine.i2c[1].bit_cycles);
        const asked = { at: cycle - zero, address: this.address, reads, hz, bytes: to_hex(bytes) };
        lines.write({ transfer: asked });
        return lines.read();
    }
}

class Board {
    constructor(lines, { watch, selects, i2c }) {
        Object.assign(this, { lines, watch, selects, i2c });
    }

    start() {
        const machine = this.machine?.reboot() ?? new Machine(first);
        Object.assign(this, { machine, zero: undefined, pins: [], usb: [], uart: [], baud: 0 });
        machine.watch(this.watch);
        machine.pio[0].on_start = (cycle) => (this.zero ??= cycle);
        machine.on_output = ({ cycle, levels, driven }) => {
            this.pins.push([cycle - this.zero, (levels & driven) >>> 0]);
            machine.stop();
        };
        machine.usb.on_bytes = (bytes, cycle) => this.usb.push([cycle - this.zero, to_hex(bytes)]);
        const uart = machine.uart[0];
        uart.on_byte = (byte) => {
            this.uart.push(byte);
            this.baud = Math.round(clk_hz / uart.bit_cycles);
        };
        this.selects.forEach((gpio, index) =>
            machine.spi[0].attach({ gpio, device: new DistantPart(this, index) }),
        );
        for (const address of this.i2c)
            machine.i2c[1].attach(address, new DistantRegisters(this, address));
        while (machine.usb.state !== 'configured') this.run_for_a_moment();
        let is_open = false;
        machine.usb.set_line_state(true, true, () => (is_open = true));
        while (!is_open) this.run_for_a_moment();
        this.lines.write({ now: machine.now - this.zero });
    }

    run_for_a_moment() {
        const why = this.machine.run_for(1000);
        if (why !== 'time' && why !== 'asked') fault(`the board stopped at its start: ${why}`);
    }

    take(command) {
        const { machine, zero } = this;
        for (const [gpio, level, cycle] of command.inputs)
            machine.set_input(gpio, level, zero + cycle);
        for (const [hex, cycle] of command.usb) machine.usb.write(from_hex(hex), zero + cycle);
        const uart = machine.uart[0];
        for (const [hex, end] of command.uart) {
            const bytes = from_hex(hex);
            const length = Math.round(bytes.length * uart.frame_bits * uart.bit_cycles);
            uart.send(bytes, zero + end - length);
        }
        machine.usb.set_reading(command.reads);
        machine.spi[0].hold(command.held);
        machine.i2c[1].hold(command.i2c_held);
    }

    run(command) {
        this.take(command);
        const why = this.machine.run_until(this.zero + command.until);
        const answer = {
            now: this.machine.now - this.zero,
            pins: this.pins,
            usb: this.usb,
            uart: [to_hex(this.uart), this.baud],
        };
        if (why !== 'time' && why !== 'asked') answer.stopped = why;
        this.pins = [];
        this.usb = [];
        this.uart = [];
        this.lines.write(answer);
    }
}

const lines = new Lines();
const board = new Board(lines, JSON.parse(process.argv[3]));
try {
    for (let command = lines.read(); command !== undefined; command = lines.read()) {
        if (command.start) board.start();
        else board.run(command);
    }
} catch (error) {
    console.error(error instanceof Fault ? `the emulated board: ${error.message}` : error);
    process.exitCode = 1;
}
