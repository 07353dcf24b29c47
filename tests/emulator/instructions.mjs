// SPDX-License-Identifier: BSD-3-Clause
// Holds each kind of instruction, as the emulated chip executes it, against a model of its own:
// results and flags by the ARMv6-M Architecture Reference Manual (DDI 0419), cycles by the
// Cortex-M0+ Technical Reference Manual (DDI 0484), table 3-1, with the multiplier of one cycle
// that the RP2040 has. The model knows nothing of the emulator.
import process from 'node:process';

import { Chip, ram_begin, ram_size } from './chip.mjs';

const code = ram_begin + 0x1000;
const data = ram_begin + 0x2000;
const data_size = 256;
const middle = data + data_size / 2;
const sp = 13;
const lr = 14;
const pc = 15;

// Where carries, signs and shifts change.
const corners = [
    0, 1, 2, 31, 32, 33, 63, 255, 256, 0x7ffffffe, 0x7fffffff, 0x80000000, 0x80000001, 0xdeadbeef,
    0xfffffffe, 0xffffffff,
];
const signed = (value) => BigInt.asIntN(32, BigInt(value));
const unsigned = (value) => Number(BigInt.asUintN(32, BigInt(value)));

/// What an instruction finds and leaves. `r[15]` is the address of the instruction, then of the
/// next one.
class Model {
    constructor(r, flags, memory) {
        this.r = [...r];
        [this.n, this.z, this.c, this.v] = [8, 4, 2, 1].map((bit) => (flags & bit) !== 0);
        this.memory = Uint8Array.from(memory);
        this.cycles = 1;
        this.next = r[pc] + 2;
    }

    /// As an operand, the program counter is two instructions ahead.
    get(register) {
        return register === pc ? this.r[pc] + 4 : this.r[register];
    }
    set(register, value) {
        if (register === pc) return this.branch(value & ~1, 2);
        this.r[register] = register === sp ? (value & ~3) >>> 0 : value >>> 0;
    }
    branch(target, cycles) {
        this.next = target >>> 0;
        this.cycles = cycles;
    }
    /// Sets N and Z, and returns the result.
    logic(result) {
        this.n = result >>> 31 === 1;
        this.z = result >>> 0 === 0;
        return result >>> 0;
    }
    add(left, right, carry) {
        const sum = BigInt(left) + BigInt(right) + BigInt(carry);
        const result = unsigned(sum);
        this.c = BigInt(result) !== sum;
        this.v = signed(result) !== signed(left) + signed(right) + BigInt(carry);
        return this.logic(result);
    }
    subtract(left, right, carry = 1) {
        return this.add(left, ~right >>> 0, carry);
    }
    /// Bit by bit, as nobody else does.
    shift(kind, value, count) {
        let result = value;
        for (let i = 0; i < count; ++i) {
            const low = result & 1;
            const high = result >>> 31;
            this.c = (kind === 'lsl' ? high : low) === 1;
            if (kind === 'lsl') result = (result << 1) >>> 0;
            else if (kind === 'lsr') result = result >>> 1;
            else if (kind === 'asr') result = ((result >>> 1) | (high << 31)) >>> 0;
            else result = ((result >>> 1) | (low << 31)) >>> 0;
        }
        return this.logic(result);
    }
    read(address, size) {
        let value = 0;
        for (let i = size; i-- > 0;) value = value * 256 + this.memory[address + i - data];
        return value;
    }
    write(address, size, value) {
        for (let i = 0; i < size; ++i) this.memory[address + i - data] = (value >>> (8 * i)) & 0xff;
    }
    holds(condition) {
        const { n, z, c, v } = this;
        const tests = [z, c, n, v, c && !z, n === v, n === v && !z];
        return tests[condition >>> 1] !== ((condition & 1) === 1);
    }
}

let failures = 0;
let cases = 0;
const chip = new Chip();
const { core } = chip;
const flag_names = ['N', 'Z', 'C', 'V'];

let random_state = 1;
function random() {
    random_state = (Math.imul(random_state, 1664525) + 1013904223) >>> 0;
    return random_state;
}

function describe(name, halves, before, flags, problem) {
    const show = (value) => `0x${(value >>> 0).toString(16)}`;
    const registers = before.map((value, index) => `r${index}=${show(value)}`).join(' ');
    console.error(
        `${name} ${halves.map(show).join(' ')}: ${problem}; before: ${registers} flags=${flags}`,
    );
}

/// Executes `halves` on the chip and `effect` on the model. Registers default to noise.
function check(name, halves, registers, flags, effect) {
    const r = Array.from({ length: 16 }, (_, index) => registers[index] ?? random());
    r[sp] = registers[sp] ?? middle;
    r[pc] = code;
    const memory = Uint8Array.from({ length: data_size }, () => random() >>> 24);
    const model = new Model(r, flags, memory);
    effect(model);
    halves.forEach((half, index) => core.writeUint16(code + 2 * index, half));
    chip.load(data, memory);
    r.forEach((value, index) => (core.registers[index] = value));
    [core.N, core.Z, core.C, core.V] = [8, 4, 2, 1].map((bit) => (flags & bit) !== 0);
    const cycles = chip.step();
    model.r[pc] = model.next;
    const problems = [];
    model.r.forEach((value, index) => {
        if (core.registers[index] !== value)
            problems.push(`r${index}: ${core.registers[index]}, not ${value}`);
    });
    [model.n, model.z, model.c, model.v].forEach((value, index) => {
        const name_of_flag = flag_names[index];
        if (core[name_of_flag] !== value) problems.push(`${name_of_flag} is not ${value}`);
    });
    for (let i = 0; i < data_size; ++i)
        if (core.readUint8(data + i) !== model.memory[i]) problems.push(`memory differs at ${i}`);
    if (cycles !== model.cycles) problems.push(`${cycles} cycles, not ${model.cycles}`);
    ++cases;
    if (problems.length === 0) return;
    if (++failures <= 20) describe(name, halves, r, flags, problems.join(', '));
}

/// The chip must stop with an error, there or at what comes next.
function check_refused(name, halves, registers = {}) {
    Array.from({ length: 16 }, (_, index) => (core.registers[index] = registers[index] ?? middle));
    core.registers[pc] = code;
    halves.forEach((half, index) => core.writeUint16(code + 2 * index, half));
    ++cases;
    try {
        chip.step();
        chip.step();
    } catch {
        return;
    }
    ++failures;
    console.error(`${name} is not refused`);
}

function each_operand(visit) {
    for (const left of corners)
        for (const right of corners) for (const flags of [0, 1, 2, 15]) visit(left, right, flags);
}

function data_processing() {
    const operations = {
        ANDS: (m, d, s) => m.set(d, m.logic(m.r[d] & m.r[s])),
        EORS: (m, d, s) => m.set(d, m.logic(m.r[d] ^ m.r[s])),
        LSLS: (m, d, s) => m.set(d, m.shift('lsl', m.r[d], m.r[s] & 0xff)),
        LSRS: (m, d, s) => m.set(d, m.shift('lsr', m.r[d], m.r[s] & 0xff)),
        ASRS: (m, d, s) => m.set(d, m.shift('asr', m.r[d], m.r[s] & 0xff)),
        ADCS: (m, d, s) => m.set(d, m.add(m.r[d], m.r[s], m.c ? 1 : 0)),
        SBCS: (m, d, s) => m.set(d, m.subtract(m.r[d], m.r[s], m.c ? 1 : 0)),
        RORS: (m, d, s) => m.set(d, m.shift('ror', m.r[d], m.r[s] & 0xff)),
        TST: (m, d, s) => m.logic(m.r[d] & m.r[s]),
        RSBS: (m, d, s) => m.set(d, m.subtract(0, m.r[s])),
        CMP: (m, d, s) => m.subtract(m.r[d], m.r[s]),
        CMN: (m, d, s) => m.add(m.r[d], m.r[s], 0),
        ORRS: (m, d, s) => m.set(d, m.logic(m.r[d] | m.r[s])),
        MULS: (m, d, s) => m.set(d, m.logic(unsigned(BigInt(m.r[d]) * BigInt(m.r[s])))),
        BICS: (m, d, s) => m.set(d, m.logic(m.r[d] & ~m.r[s])),
        MVNS: (m, d, s) => m.set(d, m.logic(~m.r[s])),
    };
    Object.entries(operations).forEach(([name, effect], index) => {
        each_operand((left, right, flags) => {
            const opcode = 0x4000 | (index << 6);
            check(name, [opcode | (6 << 3) | 1], { 1: left, 6: right }, flags, (m) =>
                effect(m, 1, 6),
            );
            if (left === right)
                check(name, [opcode | (3 << 3) | 3], { 3: left }, flags, (m) => effect(m, 3, 3));
        });
    });
}

function with_immediate() {
    const shifts = ['lsl', 'lsr', 'asr'];
    for (const value of corners)
        for (let count = 0; count < 32; ++count)
            shifts.forEach((kind, index) => {
                // To the right, 0 stands for 32.
                const by = kind !== 'lsl' && count === 0 ? 32 : count;
                const opcode = (index << 11) | (count << 6) | (5 << 3) | 2;
                for (const flags of [0, 15])
                    check(`${kind} #`, [opcode], { 5: value }, flags, (m) =>
                        m.set(2, m.shift(kind, m.r[5], by)),
                    );
            });
    each_operand((left, right, flags) => {
        const small = right & 7;
        const byte = right & 0xff;
        check('ADDS', [0x1800 | (7 << 6) | (1 << 3)], { 1: left, 7: right }, flags, (m) =>
            m.set(0, m.add(left, right, 0)),
        );
        check('SUBS', [0x1a00 | (7 << 6) | (1 << 3)], { 1: left, 7: right }, flags, (m) =>
            m.set(0, m.subtract(left, right)),
        );
        check('ADDS #3', [0x1c00 | (small << 6) | (1 << 3) | 4], { 1: left }, flags, (m) =>
            m.set(4, m.add(left, small, 0)),
        );
        check('SUBS #3', [0x1e00 | (small << 6) | (1 << 3) | 4], { 1: left }, flags, (m) =>
            m.set(4, m.subtract(left, small)),
        );
        check('MOVS #', [0x2000 | (3 << 8) | byte], {}, flags, (m) => m.set(3, m.logic(byte)));
        check('CMP #', [0x2800 | (3 << 8) | byte], { 3: left }, flags, (m) =>
            m.subtract(left, byte),
        );
        check('ADDS #', [0x3000 | (3 << 8) | byte], { 3: left }, flags, (m) =>
            m.set(3, m.add(left, byte, 0)),
        );
        check('SUBS #', [0x3800 | (3 << 8) | byte], { 3: left }, flags, (m) =>
            m.set(3, m.subtract(left, byte)),
        );
    });
}

function high_registers() {
    const opcode = (kind, d, s) => 0x4400 | (kind << 8) | ((d & 8) << 4) | (s << 3) | (d & 7);
    each_operand((left, right, flags) => {
        check('ADD', [opcode(0, 9, 2)], { 9: left, 2: right }, flags, (m) =>
            m.set(9, left + right),
        );
        check('CMP', [opcode(1, 12, 1)], { 12: left, 1: right }, flags, (m) =>
            m.subtract(left, right),
        );
        check('MOV', [opcode(2, 10, 3)], { 3: right }, flags, (m) => m.set(10, right));
    });
    check('MOV from SP', [opcode(2, 4, sp)], {}, 0, (m) => m.set(4, middle));
    check('MOV to SP', [opcode(2, sp, 4)], { 4: data + 18 }, 0, (m) => m.set(sp, data + 16));
    check('ADD to SP', [opcode(0, sp, 4)], { 4: -16 >>> 0 }, 0, (m) => m.set(sp, middle - 16));
    check('MOV from PC', [opcode(2, 4, pc)], {}, 0, (m) => m.set(4, code + 4));
    check('MOV to PC', [opcode(2, pc, 4)], { 4: code + 0x101 }, 0, (m) => m.set(pc, code + 0x101));
    check('ADD to PC', [opcode(0, pc, 4)], { 4: 0x40 }, 0, (m) => m.set(pc, code + 4 + 0x40));
    for (const count of [0, 1, 127]) {
        check('ADD SP', [0xb000 | count], {}, 0, (m) => m.set(sp, middle + 4 * count));
        check('SUB SP', [0xb080 | count], {}, 0, (m) => m.set(sp, middle - 4 * count));
        check('ADD SP #', [0xa800 | (5 << 8) | count], {}, 0, (m) => m.set(5, middle + 4 * count));
        check('ADR', [0xa000 | (5 << 8) | count], {}, 0, (m) => m.set(5, code + 4 + 4 * count));
    }
}

function conversions() {
    const byte_of = (value, index) => (value >>> (8 * index)) & 0xff;
    const joined = (value, order) =>
        order.reduce((sum, from, to) => sum + byte_of(value, from) * 2 ** (8 * to), 0);
    const extended = (value, bits) => unsigned(BigInt.asIntN(bits, BigInt(value)));
    for (const value of [...corners, 0x80, 0x8000, 0x12345678, 0xff7f, 0xfedcba98]) {
        const run = (name, opcode, result) =>
            check(name, [opcode | (4 << 3) | 1], { 4: value }, 5, (m) => m.set(1, result));
        run('SXTH', 0xb200, extended(value & 0xffff, 16));
        run('SXTB', 0xb240, extended(value & 0xff, 8));
        run('UXTH', 0xb280, value & 0xffff);
        run('UXTB', 0xb2c0, value & 0xff);
        run('REV', 0xba00, joined(value, [3, 2, 1, 0]));
        run('REV16', 0xba40, joined(value, [1, 0, 3, 2]));
        run('REVSH', 0xbac0, extended(joined(value, [1, 0]), 16));
    }
    check('NOP', [0xbf00], {}, 9, () => {});
}

function single_transfers() {
    const extended = (value, bits) => unsigned(BigInt.asIntN(bits, BigInt(value)));
    const load =
        (address, size, extend = (value) => value) =>
        (m) => {
            m.cycles = 2;
            m.set(1, extend(m.read(address, size)));
        };
    const store = (address, size) => (m) => {
        m.cycles = 2;
        m.write(address, size, m.r[1]);
    };
    for (const index of [0, 1, 2, 5, 15, 31]) {
        const at = (scale) => data + scale * index;
        const immediate = (opcode) => [opcode | (index << 6) | (2 << 3) | 1];
        const base = { 2: data };
        check('STR #', immediate(0x6000), base, 0, store(at(4), 4));
        check('LDR #', immediate(0x6800), base, 0, load(at(4), 4));
        check('STRB #', immediate(0x7000), base, 0, store(at(1), 1));
        check('LDRB #', immediate(0x7800), base, 0, load(at(1), 1));
        check('STRH #', immediate(0x8000), base, 0, store(at(2), 2));
        check('LDRH #', immediate(0x8800), base, 0, load(at(2), 2));
        check('STR SP', [0x9000 | (1 << 8) | index], { [sp]: data }, 0, store(at(4), 4));
        check('LDR SP', [0x9800 | (1 << 8) | index], { [sp]: data }, 0, load(at(4), 4));
        const by_register = (opcode) => [opcode | (3 << 6) | (2 << 3) | 1];
        for (const offset of [4 * index, -4 * index]) {
            const registers = { 2: middle, 3: offset >>> 0 };
            const address = middle + offset;
            if (address + 4 > data + data_size) continue;
            check('STR', by_register(0x5000), registers, 0, store(address, 4));
            check('STRH', by_register(0x5200), registers, 0, store(address, 2));
            check('STRB', by_register(0x5400), registers, 0, store(address, 1));
            check(
                'LDRSB',
                by_register(0x5600),
                registers,
                0,
                load(address, 1, (v) => extended(v, 8)),
            );
            check('LDR', by_register(0x5800), registers, 0, load(address, 4));
            check('LDRH', by_register(0x5a00), registers, 0, load(address, 2));
            check('LDRB', by_register(0x5c00), registers, 0, load(address, 1));
            check(
                'LDRSH',
                by_register(0x5e00),
                registers,
                0,
                load(address, 2, (v) => extended(v, 16)),
            );
        }
    }
    check('LDR literal', [0x4800 | (1 << 8) | 1, 0, 0, 0, 0x5678, 0x1234], {}, 0, (m) => {
        m.cycles = 2;
        m.set(1, 0x12345678);
    });
}

function multiple_transfers() {
    const listed = (list, link) =>
        [0, 1, 2, 3, 4, 5, 6, 7].filter((bit) => (list >>> bit) & 1).concat(link);
    const store_all = (m, registers, begin) =>
        registers.forEach((register, index) => m.write(begin + 4 * index, 4, m.r[register]));
    const load_all = (m, registers, begin) =>
        registers.forEach((register, index) => m.set(register, m.read(begin + 4 * index, 4)));
    for (let list = 0; list < 256; ++list) {
        const plain = listed(list, []);
        const linked = listed(list, [lr]);
        if (list !== 0)
            check('PUSH', [0xb400 | list], {}, 0, (m) => {
                m.cycles = 1 + plain.length;
                store_all(m, plain, middle - 4 * plain.length);
                m.set(sp, middle - 4 * plain.length);
            });
        check('PUSH LR', [0xb500 | list], {}, 0, (m) => {
            m.cycles = 1 + linked.length;
            store_all(m, linked, middle - 4 * linked.length);
            m.set(sp, middle - 4 * linked.length);
        });
        if (list !== 0)
            check('POP', [0xbc00 | list], {}, 0, (m) => {
                m.cycles = 1 + plain.length;
                load_all(m, plain, middle);
                m.set(sp, middle + 4 * plain.length);
            });
        check('POP PC', [0xbd00 | list], {}, 0, (m) => {
            load_all(m, plain, middle);
            const target = m.read(middle + 4 * plain.length, 4);
            m.set(sp, middle + 4 * linked.length);
            m.branch(target & ~1, 3 + linked.length);
        });
        if (list === 0) continue;
        const base = 7;
        const in_list = ((list >>> base) & 1) === 1;
        check('LDM', [0xc800 | (base << 8) | list], { 7: data }, 0, (m) => {
            m.cycles = 1 + plain.length;
            if (!in_list) m.set(base, data + 4 * plain.length);
            load_all(m, plain, data);
        });
        if (in_list) continue;
        check('STM', [0xc000 | (base << 8) | list], { 7: data }, 0, (m) => {
            m.cycles = 1 + plain.length;
            store_all(m, plain, data);
            m.set(base, data + 4 * plain.length);
        });
    }
}

function branches() {
    for (let condition = 0; condition < 14; ++condition)
        for (let flags = 0; flags < 16; ++flags)
            for (const offset of [-256, -2, 0, 254])
                check(
                    'Bcc',
                    [0xd000 | (condition << 8) | ((offset >> 1) & 0xff)],
                    {},
                    flags,
                    (m) => {
                        if (m.holds(condition)) m.branch(code + 4 + offset, 2);
                    },
                );
    for (const offset of [-2048, -2, 0, 2046])
        check('B', [0xe000 | ((offset >> 1) & 0x7ff)], {}, 0, (m) =>
            m.branch(code + 4 + offset, 2),
        );
    for (const offset of [-(2 ** 24), -0x123456, -2, 0, 2, 0x923456, 2 ** 24 - 2]) {
        const sign = offset < 0 ? 1 : 0;
        const inverted = (bit) => 1 ^ sign ^ ((offset >> bit) & 1);
        const first = 0xf000 | (sign << 10) | ((offset >> 12) & 0x3ff);
        const second =
            0xd000 | (inverted(23) << 13) | (inverted(22) << 11) | ((offset >> 1) & 0x7ff);
        check('BL', [first, second], {}, 0, (m) => {
            m.set(lr, code + 5);
            m.branch(code + 4 + offset, 3);
        });
    }
    check('BX', [0x4700 | (lr << 3)], { [lr]: code + 0x201 }, 0, (m) => m.branch(code + 0x200, 2));
    check('BLX', [0x4780 | (4 << 3)], { 4: code + 0x201 }, 0, (m) => {
        m.set(lr, code + 3);
        m.branch(code + 0x200, 2);
    });
}

function refusals() {
    check_refused('an unaligned LDR', [0x6811], { 2: data + 2 });
    check_refused('an unaligned STR', [0x6011], { 2: data + 1 });
    check_refused('an unaligned LDRH', [0x8811], { 2: data + 1 });
    check_refused('an unaligned STRH', [0x8011], { 2: data + 3 });
    check_refused('an unaligned LDM', [0xca03], { 2: data + 2 });
    check_refused('reading from address 0', [0x7811], { 2: 0 });
    check_refused('writing to address 0', [0x7011], { 2: 0 });
    check_refused('reading behind RAM', [0x6811], { 2: ram_begin + ram_size });
    check_refused('a peripheral in reset', [0x6811], { 2: 0x40034000 });
    check_refused('a jump into nothing', [0x4760], { 12: 0x1000 }); // BX R12
    check_refused('an undefined instruction', [0xde00]);
    check_refused('a breakpoint', [0xbe00]);
    check_refused('an instruction of other processors', [0xeb00, 0x0000]);
    check_refused('STM of its own base', [0xc206]);
    check_refused('WFI', [0xbf30]);
}

data_processing();
with_immediate();
high_registers();
conversions();
single_transfers();
multiple_transfers();
branches();
refusals();
console.log(`${cases} cases of instructions, ${failures} failed`);
process.exitCode = failures === 0 ? 0 : 1;
