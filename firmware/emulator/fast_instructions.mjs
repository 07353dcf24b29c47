// SPDX-License-Identifier: BSD-3-Clause
// The instructions that programs execute most, by one look into a table instead of rp2040js' long
// chain of comparisons. The test of all instructions holds these, too, against its model.

const sp = 13;
const lr = 14;
const pc = 15;

/// What a transfer takes besides the instruction: nothing at SIO, more at slow registers.
function read_cycles(address) {
    const region = address >>> 28;
    if (region === 0xd) return 1;
    return region === 4 ? 4 : 2;
}
function write_cycles(address) {
    const region = address >>> 28;
    if (region === 0xd) return 1;
    return region === 4 ? 5 : 2;
}

function set_nz(core, result) {
    core.N = result < 0;
    core.Z = result === 0;
}

function add(core, left, right) {
    const sum = left + right;
    const result = sum | 0;
    core.N = result < 0;
    core.Z = result === 0;
    core.C = sum > 0xffffffff;
    core.V = ((left ^ result) & (right ^ result)) < 0;
    return result;
}

function subtract(core, left, right) {
    const result = (left - right) | 0;
    core.N = result < 0;
    core.Z = result === 0;
    core.C = left >= right;
    core.V = ((left ^ right) & (left ^ result)) < 0;
    return result;
}

function holds(core, condition) {
    switch (condition) {
        case 0:
            return core.Z;
        case 1:
            return !core.Z;
        case 2:
            return core.C;
        case 3:
            return !core.C;
        case 4:
            return core.N;
        case 5:
            return !core.N;
        case 6:
            return core.V;
        case 7:
            return !core.V;
        case 8:
            return core.C && !core.Z;
        case 9:
            return !core.C || core.Z;
        case 10:
            return core.N === core.V;
        case 11:
            return core.N !== core.V;
        case 12:
            return !core.Z && core.N === core.V;
        default:
            return core.Z || core.N !== core.V;
    }
}

function push(core, r, list) {
    let count = 0;
    for (let left = list; left !== 0; left &= left - 1) ++count;
    let address = r[sp] - 4 * count;
    r[sp] = address;
    for (let i = 0; i < 8; ++i)
        if ((list >>> i) & 1) {
            core.writeUint32(address, r[i]);
            address += 4;
        }
    if (list & 0x100) core.writeUint32(address, r[lr]);
    return 1 + count;
}

function pop(core, r, list) {
    let address = r[sp];
    let cycles = 1;
    for (let i = 0; i < 8; ++i)
        if ((list >>> i) & 1) {
            r[i] = core.readUint32(address);
            address += 4;
            ++cycles;
        }
    if (!(list & 0x100)) {
        r[sp] = address;
        return cycles;
    }
    r[sp] = address + 4;
    core.BXWritePC(core.readUint32(address));
    return cycles + 3;
}

/// Each executes `opcode`, on the core's registers `r`, and returns its cycles.
const op = {
    lsl(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const value = r[n];
        const count = (opcode >>> 6) & 31;
        const result = value << count;
        r[d] = result;
        set_nz(core, result);
        if (count !== 0) core.C = ((value >>> (32 - count)) & 1) === 1;
        return 1;
    },
    lsr(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const value = r[n];
        const count = (opcode >>> 6) & 31;
        const result = count === 0 ? 0 : (value >>> count) | 0;
        r[d] = result;
        set_nz(core, result);
        core.C = ((value >>> ((count - 1) & 31)) & 1) === 1;
        return 1;
    },
    asr(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const value = r[n];
        const count = (opcode >>> 6) & 31 || 32;
        const result = value >> Math.min(count, 31);
        r[d] = result;
        set_nz(core, result);
        core.C = ((value >>> (count - 1)) & 1) === 1;
        return 1;
    },
    add(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = add(core, r[n], r[(opcode >>> 6) & 7]);
        return 1;
    },
    sub(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = subtract(core, r[n], r[(opcode >>> 6) & 7]);
        return 1;
    },
    add3(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = add(core, r[n], (opcode >>> 6) & 7);
        return 1;
    },
    sub3(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = subtract(core, r[n], (opcode >>> 6) & 7);
        return 1;
    },
    mov8(core, r, opcode) {
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        r[high] = opcode & 0xff;
        core.N = false;
        core.Z = (opcode & 0xff) === 0;
        return 1;
    },
    cmp8(core, r, opcode) {
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        subtract(core, r[high], opcode & 0xff);
        return 1;
    },
    add8(core, r, opcode) {
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        r[high] = add(core, r[high], opcode & 0xff);
        return 1;
    },
    sub8(core, r, opcode) {
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        r[high] = subtract(core, r[high], opcode & 0xff);
        return 1;
    },
    and(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        set_nz(core, (r[d] &= r[n]) | 0);
        return 1;
    },
    eor(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        set_nz(core, (r[d] ^= r[n]) | 0);
        return 1;
    },
    tst(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        set_nz(core, r[d] & r[n]);
        return 1;
    },
    rsb(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = subtract(core, 0, r[n]);
        return 1;
    },
    cmp(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        subtract(core, r[d], r[n]);
        return 1;
    },
    cmn(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        add(core, r[d], r[n]);
        return 1;
    },
    orr(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        set_nz(core, (r[d] |= r[n]) | 0);
        return 1;
    },
    mul(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const result = Math.imul(r[d], r[n]);
        r[d] = result;
        set_nz(core, result);
        return 1;
    },
    bic(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        set_nz(core, (r[d] &= ~r[n]) | 0);
        return 1;
    },
    mvn(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const result = ~r[n];
        r[d] = result;
        set_nz(core, result);
        return 1;
    },
    add_high(core, r, opcode) {
        const d = opcode & 7;
        r[pc] += 2;
        const target = d | ((opcode >>> 4) & 8);
        r[target] += r[(opcode >>> 3) & 15];
        return 1;
    },
    mov_high(core, r, opcode) {
        const d = opcode & 7;
        r[pc] += 2;
        r[d | ((opcode >>> 4) & 8)] = r[(opcode >>> 3) & 15];
        return 1;
    },
    ldr_literal(core, r, opcode) {
        const at = r[pc];
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        const address = ((at + 4) & ~3) + 4 * (opcode & 0xff);
        r[high] = core.readUint32(address);
        return read_cycles(address);
    },
    str_r(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + r[(opcode >>> 6) & 7]) >>> 0;
        core.writeUint32(address, r[d]);
        return write_cycles(address);
    },
    strh_r(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + r[(opcode >>> 6) & 7]) >>> 0;
        core.writeUint16(address, r[d]);
        return write_cycles(address);
    },
    strb_r(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + r[(opcode >>> 6) & 7]) >>> 0;
        core.writeUint8(address, r[d]);
        return write_cycles(address);
    },
    ldrsb_r(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + r[(opcode >>> 6) & 7]) >>> 0;
        r[d] = (core.readUint8(address) << 24) >> 24;
        return read_cycles(address);
    },
    ldr_r(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + r[(opcode >>> 6) & 7]) >>> 0;
        r[d] = core.readUint32(address);
        return read_cycles(address);
    },
    ldrh_r(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + r[(opcode >>> 6) & 7]) >>> 0;
        r[d] = core.readUint16(address);
        return read_cycles(address);
    },
    ldrb_r(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + r[(opcode >>> 6) & 7]) >>> 0;
        r[d] = core.readUint8(address);
        return read_cycles(address);
    },
    ldrsh_r(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + r[(opcode >>> 6) & 7]) >>> 0;
        r[d] = (core.readUint16(address) << 16) >> 16;
        return read_cycles(address);
    },
    str(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + ((opcode >>> 4) & 0x7c)) >>> 0;
        core.writeUint32(address, r[d]);
        return write_cycles(address);
    },
    ldr(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + ((opcode >>> 4) & 0x7c)) >>> 0;
        r[d] = core.readUint32(address);
        return read_cycles(address);
    },
    strb(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + ((opcode >>> 6) & 31)) >>> 0;
        core.writeUint8(address, r[d]);
        return write_cycles(address);
    },
    ldrb(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + ((opcode >>> 6) & 31)) >>> 0;
        r[d] = core.readUint8(address);
        return read_cycles(address);
    },
    strh(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + ((opcode >>> 5) & 0x3e)) >>> 0;
        core.writeUint16(address, r[d]);
        return write_cycles(address);
    },
    ldrh(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        const address = (r[n] + ((opcode >>> 5) & 0x3e)) >>> 0;
        r[d] = core.readUint16(address);
        return read_cycles(address);
    },
    str_sp(core, r, opcode) {
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        const address = (r[sp] + 4 * (opcode & 0xff)) >>> 0;
        core.writeUint32(address, r[high]);
        return write_cycles(address);
    },
    ldr_sp(core, r, opcode) {
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        const address = (r[sp] + 4 * (opcode & 0xff)) >>> 0;
        r[high] = core.readUint32(address);
        return read_cycles(address);
    },
    adr(core, r, opcode) {
        const at = r[pc];
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        r[high] = ((at + 4) & ~3) + 4 * (opcode & 0xff);
        return 1;
    },
    add_rd_sp(core, r, opcode) {
        const high = (opcode >>> 8) & 7;
        r[pc] += 2;
        r[high] = r[sp] + 4 * (opcode & 0xff);
        return 1;
    },
    sxth(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = (r[n] << 16) >> 16;
        return 1;
    },
    sxtb(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = (r[n] << 24) >> 24;
        return 1;
    },
    uxth(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = r[n] & 0xffff;
        return 1;
    },
    uxtb(core, r, opcode) {
        const d = opcode & 7;
        const n = (opcode >>> 3) & 7;
        r[pc] += 2;
        r[d] = r[n] & 0xff;
        return 1;
    },
    branch_if(core, r, opcode) {
        const at = r[pc];
        const taken = holds(core, (opcode >>> 8) & 15);
        r[pc] = taken ? at + 4 + ((opcode << 24) >> 23) : at + 2;
        return taken ? 2 : 1;
    },
    branch(core, r, opcode) {
        r[pc] += 4 + ((opcode << 21) >> 20);
        return 2;
    },
    push(core, r, opcode) {
        r[pc] += 2;
        return push(core, r, opcode & 0x1ff);
    },
    pop(core, r, opcode) {
        r[pc] += 2;
        return pop(core, r, opcode & 0x1ff);
    },
    bl(core, r, opcode) {
        const at = r[pc];
        const second = core.readUint16(at + 2);
        if ((second & 0xd000) !== 0xd000) return core.executeInstruction();
        const sign = (opcode << 21) >> 31; // all bits
        const high = ((second >>> 13) & 1) ^ (sign & 1) ^ 1;
        const low = ((second >>> 11) & 1) ^ (sign & 1) ^ 1;
        const near = ((opcode & 0x3ff) << 12) | ((second & 0x7ff) << 1);
        r[lr] = (at + 4) | 1;
        r[pc] = at + 4 + ((sign << 24) | (high << 23) | (low << 22) | near);
        core.blTaken(core, false);
        return 3;
    },
    ldm(core, r, opcode) {
        const base = (opcode >>> 8) & 7;
        let address = r[base];
        let cycles = 1;
        r[pc] += 2;
        for (let i = 0; i < 8; ++i)
            if ((opcode >>> i) & 1) {
                r[i] = core.readUint32(address);
                address += 4;
                ++cycles;
            }
        if (!((opcode >>> base) & 1)) r[base] = address;
        return cycles;
    },
    stm(core, r, opcode) {
        const base = (opcode >>> 8) & 7;
        let address = r[base];
        let cycles = 1;
        r[pc] += 2;
        for (let i = 0; i < 8; ++i)
            if ((opcode >>> i) & 1) {
                core.writeUint32(address, r[i]);
                address += 4;
                ++cycles;
            }
        r[base] = address;
        return cycles;
    },
    add_sp(core, r, opcode) {
        r[pc] += 2;
        r[sp] += 4 * (opcode & 0x7f);
        return 1;
    },
    sub_sp(core, r, opcode) {
        r[pc] += 2;
        r[sp] -= 4 * (opcode & 0x7f);
        return 1;
    },
    bx(core, r, opcode) {
        const target = r[(opcode >>> 3) & 15];
        r[pc] += 2;
        core.BXWritePC(target);
        return 2;
    },
    nop(core, r) {
        r[pc] += 2;
        return 1;
    },
};

const by_five_bits = {
    0b00000: op.lsl,
    0b00001: op.lsr,
    0b00010: op.asr,
    0b00100: op.mov8,
    0b00101: op.cmp8,
    0b00110: op.add8,
    0b00111: op.sub8,
    0b01001: op.ldr_literal,
    0b01100: op.str,
    0b01101: op.ldr,
    0b01110: op.strb,
    0b01111: op.ldrb,
    0b10000: op.strh,
    0b10001: op.ldrh,
    0b10010: op.str_sp,
    0b10011: op.ldr_sp,
    0b10100: op.adr,
    0b10101: op.add_rd_sp,
    0b11100: op.branch,
};
const by_seven_bits = {
    0b0001100: op.add,
    0b0001101: op.sub,
    0b0001110: op.add3,
    0b0001111: op.sub3,
    0b0101000: op.str_r,
    0b0101001: op.strh_r,
    0b0101010: op.strb_r,
    0b0101011: op.ldrsb_r,
    0b0101100: op.ldr_r,
    0b0101101: op.ldrh_r,
    0b0101110: op.ldrb_r,
    0b0101111: op.ldrsh_r,
};
const by_ten_bits = {
    0b0100000000: op.and,
    0b0100000001: op.eor,
    0b0100001000: op.tst,
    0b0100001001: op.rsb,
    0b0100001010: op.cmp,
    0b0100001011: op.cmn,
    0b0100001100: op.orr,
    0b0100001101: op.mul,
    0b0100001110: op.bic,
    0b0100001111: op.mvn,
    0b1011001000: op.sxth,
    0b1011001001: op.sxtb,
    0b1011001010: op.uxth,
    0b1011001011: op.uxtb,
};

function operation_of(opcode) {
    if (opcode === 0xbf00) return op.nop;
    if (opcode >>> 9 === 0b1011010 && opcode & 0x1ff) return op.push;
    if (opcode >>> 9 === 0b1011110 && opcode & 0x1ff) return op.pop;
    if (opcode >>> 11 === 0b11110) return op.bl;
    if (opcode >>> 11 === 0b11001 && opcode & 0xff) return op.ldm;
    if (opcode >>> 11 === 0b11000 && opcode & 0xff) return op.stm;
    if (opcode >>> 7 === 0b101100000) return op.add_sp;
    if (opcode >>> 7 === 0b101100001) return op.sub_sp;
    if (opcode >>> 7 === 0b010001110 && (opcode & 0x7f) < 0x78) return op.bx;
    if (opcode >>> 12 === 0b1101 && ((opcode >>> 8) & 15) < 14) return op.branch_if;
    const touches_pc = (opcode & 0x87) === 0x87 || ((opcode >>> 3) & 15) === pc;
    const touches_sp = (opcode & 0x87) === 0x85;
    if (opcode >>> 8 === 0b01000100 && !touches_pc && !touches_sp) return op.add_high;
    if (opcode >>> 8 === 0b01000110 && !touches_pc && !touches_sp) return op.mov_high;
    return by_five_bits[opcode >>> 11] ?? by_seven_bits[opcode >>> 9] ?? by_ten_bits[opcode >>> 6];
}

const table = Array.from({ length: 0x10000 }, (_, opcode) => operation_of(opcode));

export const is_frequent = (opcode) => table[opcode] !== undefined;

export function execute_frequent(core, r, opcode) {
    return table[opcode](core, r, opcode);
}
