// SPDX-License-Identifier: BSD-3-Clause
// Which block answers at which address, for processor and DMA. Each access must be aligned and go
// to a block that is not in reset; everything else is a fault. In registers, only bits that are
// writable on the chip are written.
import { ram_begin, ram_size } from './chip.mjs';
import { fault, hex } from './fault.mjs';
import { RegisterMasks } from './registers.mjs';

const rom_size = 0x4000;
const xip_begin = 0x10000000;
const xip_end = 0x14000000; // four windows of 16 MiB with different caching
const xip_window = 0x1000000;
const dpram_begin = 0x50100000;
const dpram_size = 0x1000;
const block_bits = 14;
const alias_shift = 12; // of the address bits that choose how a register is written

// RAM begins with this, so that a program that forgets to set a variable is seen.
const junk = 0xa5;

const write_plain = 0;
const write_xor = 1;
const write_set = 2;

/// A register's value after a write of `value` through an alias.
function aliased(alias, before, value) {
    if (alias === write_plain) return value;
    if (alias === write_xor) return (before ^ value) >>> 0;
    return (alias === write_set ? before | value : before & ~value) >>> 0;
}

export class Bus {
    /// `where` gives the present place in the program, for errors.
    constructor(where) {
        this.where = where;
        this.ram = new Uint8Array(ram_size).fill(junk);
        this.halves = new Uint16Array(this.ram.buffer);
        this.words = new Uint32Array(this.ram.buffer);
        this.blocks = new Map();
        this.rom = new Uint8Array(rom_size);
    }

    /// `block` has read(offset) and write(offset, value, raw): `value` is what the register becomes
    /// through an alias, `raw` what was written. `is_held()`: whether it is in reset.
    add(name, begin, block, is_held = () => false, has_aliases = true) {
        const masks = new RegisterMasks(begin, block.also_written);
        this.blocks.set(begin >>> block_bits, { name, block, is_held, has_aliases, masks });
    }

    fail(what, address) {
        fault(`${what} ${hex(address)}, ${this.where()}`);
    }

    block_at(what, address) {
        const found = this.blocks.get(address >>> block_bits);
        if (found === undefined) this.fail(`${what}: nothing is at`, address);
        if (found.is_held()) this.fail(`${what}: ${found.name} is in reset, at`, address);
        return found;
    }

    /// Reads `size` bytes outside of RAM.
    read(address, size) {
        address >>>= 0;
        if (address & (size - 1)) this.fail(`unaligned read of ${size} bytes at`, address);
        const word = this.read_word((address & ~3) >>> 0);
        if (size === 4) return word >>> 0;
        const shifted = word >>> (8 * (address & 3));
        return size === 2 ? shifted & 0xffff : shifted & 0xff;
    }

    read_word(address) {
        if (address < rom_size) return new DataView(this.rom.buffer).getUint32(address, true);
        if (address >= xip_begin && address < xip_end)
            return this.flash.read_mapped(address & (xip_window - 1));
        if (address >= dpram_begin && address < dpram_begin + dpram_size)
            return this.dpram_at('read').read_memory(address - dpram_begin);
        const found = this.block_at('read', address);
        return found.block.read(this.register_at('read', found, address)) >>> 0;
    }

    write(address, value, size) {
        address >>>= 0;
        value >>>= 0;
        if (address & (size - 1)) this.fail(`unaligned write of ${size} bytes at`, address);
        if (address < rom_size) this.fail('write to ROM at', address);
        if (address >= xip_begin && address < xip_end) this.fail('write to flash at', address);
        if (address >= dpram_begin && address < dpram_begin + dpram_size)
            return this.dpram_at('write').write_memory(address - dpram_begin, value, size);
        // Registers take what is on all 32 lines: a narrow value is on each of its lanes.
        if (size === 1) value = Math.imul(value & 0xff, 0x01010101) >>> 0;
        if (size === 2) value = Math.imul(value & 0xffff, 0x00010001) >>> 0;
        this.write_register((address & ~3) >>> 0, value);
    }

    write_register(address, value) {
        const found = this.block_at('write', address);
        const { block, has_aliases, masks } = found;
        const offset = this.register_at('write', found, address);
        const mask = masks.written[offset >>> 2];
        if (mask === 0) return;
        const raw = (value & mask) >>> 0;
        const alias = has_aliases ? (address >>> alias_shift) & 3 : write_plain;
        if (alias === write_plain) return block.write(offset, raw, raw);
        block.write(offset, (aliased(alias, block.read(offset), value) & mask) >>> 0, raw);
    }

    /// The offset of the register at `address`, if the chip has one.
    register_at(what, { name, has_aliases, masks }, address) {
        const offset = address & (has_aliases ? 0xfff : 0x3fff);
        if (masks.exists[offset >>> 2] === 0)
            this.fail(`${what}: ${name} has no register ${hex(offset)}, at`, address);
        return offset;
    }

    dpram_at(what) {
        return this.block_at(`${what} of USB memory`, dpram_begin + 0x10000).block;
    }

    read32(address) {
        const offset = (address - ram_begin) >>> 0;
        if (offset < ram_size && (offset & 3) === 0) return this.words[offset >>> 2];
        return this.read(address, 4);
    }
    read16(address) {
        const offset = (address - ram_begin) >>> 0;
        if (offset < ram_size && (offset & 1) === 0) return this.halves[offset >>> 1];
        return this.read(address, 2);
    }
    read8(address) {
        const offset = (address - ram_begin) >>> 0;
        if (offset < ram_size) return this.ram[offset];
        return this.read(address, 1);
    }
    write32(address, value) {
        const offset = (address - ram_begin) >>> 0;
        if (offset < ram_size && (offset & 3) === 0) this.words[offset >>> 2] = value;
        else this.write(address, value, 4);
    }
    write16(address, value) {
        const offset = (address - ram_begin) >>> 0;
        if (offset < ram_size && (offset & 1) === 0) this.halves[offset >>> 1] = value;
        else this.write(address, value, 2);
    }
    write8(address, value) {
        const offset = (address - ram_begin) >>> 0;
        if (offset < ram_size) this.ram[offset] = value;
        else this.write(address, value, 1);
    }
}
