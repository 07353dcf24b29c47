// SPDX-License-Identifier: BSD-3-Clause
// The RP2040's processor and RAM as rp2040js emulates them, with what the emulator gets wrong put
// right, and with an error where the chip would fault or the program is lost.
import { RP2040 } from 'rp2040js';

import { InstructionSet } from './instruction_set.mjs';

export const ram_begin = 0x20000000;
export const ram_size = 264 * 1024;
const window_size = 0x1000;

const stack_pointer = 13;
const link_register = 14;
const program_counter = 15;

// RAM begins with this, so that a program that forgets to set a variable is seen.
const junk = 0xa5;

const hex = (value) => `0x${(value >>> 0).toString(16)}`;

export class Chip {
    /// `window` has read(offset) and write(offset, value) for the words at `window_begin`, or is
    /// left out.
    constructor(window, window_begin) {
        this.emulator = new RP2040();
        this.core = this.emulator.core;
        this.registers = this.core.registers;
        this.instructions = new InstructionSet(this.core);
        const lost = (component, message) => {
            throw new Error(`${component} at ${hex(this.pc)}: ${message}`);
        };
        this.emulator.logger = { debug() {}, info() {}, warn: lost, error: lost };
        this.emulator.onBreak = (code) => lost('breakpoint', code);
        this.constant_end = ram_begin; // nothing below is ever written
        this.map_memory(window, window_begin);
    }

    get pc() {
        return this.registers[program_counter];
    }
    get sp() {
        return this.registers[stack_pointer];
    }

    load(address, bytes) {
        this.emulator.sram.set(bytes, address - ram_begin);
    }

    text(address) {
        const begin = address - ram_begin;
        const { sram } = this.emulator;
        return Buffer.from(sram.subarray(begin, sram.indexOf(0, begin))).toString('latin1');
    }

    /// Nothing but RAM and the window exists, and each access is aligned.
    map_memory(window, window_begin) {
        const { core } = this;
        const bytes = this.emulator.sram.fill(junk);
        const halves = (this.halves = new Uint16Array(bytes.buffer));
        const words = new Uint32Array(bytes.buffer);
        const fault = (what, address) => {
            throw new Error(`${what} ${hex(address)}, before the instruction at ${hex(this.pc)}`);
        };
        const in_window = (address) =>
            window !== undefined && (address - window_begin) >>> 0 < window_size;
        core.readUint32 = (address) => {
            const offset = (address - ram_begin) >>> 0;
            if (offset < ram_size && (offset & 3) === 0) return words[offset >>> 2];
            if (!in_window(address) || (address & 3) !== 0) fault('read of the word at', address);
            return window.read((address - window_begin) >>> 0);
        };
        core.readUint16 = (address) => {
            const offset = (address - ram_begin) >>> 0;
            if (offset >= ram_size || offset & 1) fault('read of the half-word at', address);
            return halves[offset >>> 1];
        };
        core.readUint8 = (address) => {
            const offset = (address - ram_begin) >>> 0;
            if (offset >= ram_size) fault('read of the byte at', address);
            return bytes[offset];
        };
        const check_write = (what, address, offset, mask) => {
            const constant = offset < this.constant_end - ram_begin;
            if (offset >= ram_size || offset & mask || constant) fault(what, address);
        };
        core.writeUint32 = (address, value) => {
            const offset = (address - ram_begin) >>> 0;
            if (offset >= ram_size && in_window(address) && (address & 3) === 0)
                return window.write((address - window_begin) >>> 0, value >>> 0);
            check_write('write of the word at', address, offset, 3);
            words[offset >>> 2] = value;
        };
        core.writeUint16 = (address, value) => {
            const offset = (address - ram_begin) >>> 0;
            check_write('write of the half-word at', address, offset, 1);
            halves[offset >>> 1] = value;
        };
        core.writeUint8 = (address, value) => {
            const offset = (address - ram_begin) >>> 0;
            check_write('write of the byte at', address, offset, 0);
            bytes[offset] = value;
        };
    }

    /// Executes one instruction. Returns its cycles.
    step() {
        const opcode = this.halves[(this.registers[program_counter] - ram_begin) >>> 1];
        return this.instructions.execute(opcode);
    }

    /// Sets up a call of `address` that returns to `back`.
    enter(address, stack, back) {
        this.registers[stack_pointer] = stack;
        this.registers[link_register] = back | 1;
        this.registers[program_counter] = address & ~1;
    }
}
