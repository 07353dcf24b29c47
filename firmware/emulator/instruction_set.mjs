// SPDX-License-Identifier: BSD-3-Clause
// Executes one instruction on rp2040js' core, with what that gets wrong put right. What belongs to
// a whole machine only (sleep, events, interrupt masks) is left to its owner.
import { execute_frequent, is_frequent } from './fast_instructions.mjs';
import { fault, hex } from './fault.mjs';

const program_counter = 15;

// What executes an instruction: rp2040js 1.4.1 as it is, or a correction.
const as_emulated = 0;
const adcs = 1; // V is wrong when the carry overflows
const sbcs = 2;
const shift_by_register = 3; // C is wrong by 0 and by more than 32 bits
const refused = 4; // nobody: it differs from the chip, or no program needs it
const of_system = 5; // the owner
const frequent = 6; // fast_instructions.mjs, which is right, too, but several times as fast

function is_refused(opcode) {
    const stores_its_base = opcode >>> 11 === 0b11000 && (opcode >>> ((opcode >>> 8) & 7)) & 1;
    const calls_link_register = opcode === 0x47f0;
    const breaks = opcode >>> 8 === 0b10111110 || opcode >>> 8 === 0b11011110;
    const calls_supervisor = opcode >>> 8 === 0b11011111;
    return stores_its_base || calls_link_register || breaks || calls_supervisor;
}

function is_of_system(opcode) {
    const waits_or_signals = opcode >>> 8 === 0b10111111 && opcode !== 0xbf00; // NOP
    const masks_interrupts = opcode >>> 5 === 0b10110110011;
    return waits_or_signals || masks_interrupts;
}

function kind_of(opcode) {
    const shifts_by_register = [0b0100000010, 0b0100000011, 0b0100000100, 0b0100000111];
    if (is_refused(opcode)) return refused;
    if (is_of_system(opcode)) return of_system;
    if (opcode >>> 6 === 0b0100000101) return adcs;
    if (opcode >>> 6 === 0b0100000110) return sbcs;
    if (shifts_by_register.includes(opcode >>> 6)) return shift_by_register;
    return is_frequent(opcode) ? frequent : as_emulated;
}

const kinds = Uint8Array.from({ length: 0x10000 }, (_, opcode) => kind_of(opcode));

function refuse(opcode, address) {
    fault(`refused: instruction ${hex(opcode)} at ${hex(address)}`);
}

export class InstructionSet {
    /// `system(opcode)` executes what belongs to the machine and returns its cycles; without it,
    /// these instructions are refused.
    constructor(core, system) {
        this.core = core;
        this.registers = core.registers;
        this.system = system ?? ((opcode) => refuse(opcode, this.registers[program_counter]));
    }

    /// Executes `opcode`, which lies where the program counter points. Returns its cycles.
    execute(opcode) {
        switch (kinds[opcode]) {
            case frequent:
                return execute_frequent(this.core, this.registers, opcode);
            case as_emulated:
                return this.core.executeInstruction();
            case adcs:
                return this.add_with_carry(opcode, this.registers[(opcode >>> 3) & 7]);
            case sbcs:
                return this.add_with_carry(opcode, ~this.registers[(opcode >>> 3) & 7] >>> 0);
            case shift_by_register:
                return this.shift_by_register(opcode);
            case of_system:
                return this.system(opcode);
            default:
                return refuse(opcode, this.registers[program_counter]);
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
