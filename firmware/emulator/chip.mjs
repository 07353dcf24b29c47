// SPDX-License-Identifier: BSD-3-Clause
// The RP2040's processor and RAM as rp2040js emulates them, with what the emulator gets wrong put
// right, and with an error where the chip would fault or the program is lost.
import { RP2040 } from 'rp2040js';

export const ram_begin = 0x20000000;
export const ram_size = 264 * 1024;
const window_size = 0x1000;

const stack_pointer = 13;
const link_register = 14;
const program_counter = 15;

// RAM begins with this, so that a program that forgets to set a variable is seen.
const junk = 0xa5;

const hex = (value) => `0x${(value >>> 0).toString(16)}`;

// Who executes an instruction: rp2040js 1.4.1 as it is, or who puts it right.
const as_emulated = 0;
const adcs = 1; // V is wrong when the carry overflows
const sbcs = 2;
const shift_by_register = 3; // C is wrong by 0 and by more than 32 bits
const push_lr_or_pop_pc = 4; // one cycle too few
const refused = 5; // nobody: it does not belong into the core, or differs from the chip

function is_refused(opcode) {
    const stores_its_base = opcode >>> 11 === 0b11000 && (opcode >>> ((opcode >>> 8) & 7)) & 1;
    const calls_link_register = opcode === 0x47f0;
    const waits_or_signals = opcode >>> 8 === 0b10111111 && opcode !== 0xbf00; // NOP
    const breaks = opcode >>> 8 === 0b10111110 || opcode >>> 8 === 0b11011110;
    const calls_supervisor = opcode >>> 8 === 0b11011111;
    const masks_interrupts = opcode >>> 5 === 0b10110110011;
    const leaves = breaks || calls_supervisor || masks_interrupts;
    return stores_its_base || calls_link_register || waits_or_signals || leaves;
}

function kind_of(opcode) {
    const shifts_by_register = [0b0100000010, 0b0100000011, 0b0100000100, 0b0100000111];
    if (is_refused(opcode)) return refused;
    if (opcode >>> 6 === 0b0100000101) return adcs;
    if (opcode >>> 6 === 0b0100000110) return sbcs;
    if (shifts_by_register.includes(opcode >>> 6)) return shift_by_register;
    const pushes_lr = opcode >>> 8 === 0b10110101;
    const pops_pc = opcode >>> 8 === 0b10111101;
    return pushes_lr || pops_pc ? push_lr_or_pop_pc : as_emulated;
}

const kinds = Uint8Array.from({ length: 0x10000 }, (_, opcode) => kind_of(opcode));

export class Chip {
    /// `window` has read(offset) and write(offset, value) for the words at `window_begin`, or is
    /// left out.
    constructor(window, window_begin) {
        this.emulator = new RP2040();
        this.core = this.emulator.core;
        this.registers = this.core.registers;
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
        switch (kinds[opcode]) {
            case adcs:
                return this.add_with_carry(opcode, this.registers[(opcode >>> 3) & 7]);
            case sbcs:
                return this.add_with_carry(opcode, ~this.registers[(opcode >>> 3) & 7] >>> 0);
            case shift_by_register:
                return this.shift_by_register(opcode);
            case push_lr_or_pop_pc:
                return this.core.executeInstruction() + 1;
            case refused:
                throw new Error(`refused: instruction ${hex(opcode)} at ${hex(this.pc)}`);
            default:
                return this.core.executeInstruction();
        }
    }

    add_with_carry(opcode, right) {
        const { core, registers } = this;
        const destination = opcode & 7;
        const left = registers[destination];
        const sum = left + right + (core.C ? 1 : 0);
        const result = sum >>> 0;
        registers[destination] = result;
        core.N = result >>> 31 === 1;
        core.Z = result === 0;
        core.C = sum > 0xffffffff;
        core.V = ((left ^ result) & (right ^ result)) >>> 31 === 1;
        registers[program_counter] += 2;
        return 1;
    }

    shift_by_register(opcode) {
        const { core, registers } = this;
        const destination = opcode & 7;
        const value = registers[destination];
        const count = registers[(opcode >>> 3) & 7] & 0xff;
        if (count !== 0) {
            const [result, carry] = shifts[(opcode >>> 6) & 7](value, count);
            registers[destination] = result;
            core.C = (carry & 1) === 1;
        }
        core.N = registers[destination] >>> 31 === 1;
        core.Z = registers[destination] === 0;
        registers[program_counter] += 2;
        return 1;
    }

    /// Sets up a call of `address` that returns to `back`.
    enter(address, stack, back) {
        this.registers[stack_pointer] = stack;
        this.registers[link_register] = back | 1;
        this.registers[program_counter] = address & ~1;
    }
}

/// Result and carry of a shift by 1 to 255 bits, by the bits of the opcode.
const shifts = {
    2: (value, count) => [
        count < 32 ? value << count : 0,
        count <= 32 ? value >>> (32 - count) : 0,
    ],
    3: (value, count) => [
        count < 32 ? value >>> count : 0,
        count <= 32 ? value >>> (count - 1) : 0,
    ],
    4: (value, count) => [value >> Math.min(count, 31), value >> Math.min(count - 1, 31)],
    7: (value, count) => {
        const result =
            count & 31 ? (value >>> (count & 31)) | (value << (32 - (count & 31))) : value;
        return [result, result >>> 31];
    },
};
