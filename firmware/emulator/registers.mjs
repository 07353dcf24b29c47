// SPDX-License-Identifier: BSD-3-Clause
// Which registers the chip has, and blocks that the program sets up but that do nothing of interest
// here.
import { fault, hex } from './fault.mjs';
import { register_facts } from './register_facts.mjs';

export const page_size = 0x4000; // of a block's addresses
const page_of = (address) => address - (address % page_size);

/// All registers, by the page of their block: {block, begin, registers}, the last by address:
/// {name, address, reset, writable, clears}; `reset` is undefined where none is stated.
function parse(text) {
    const pages = new Map();
    let block;
    let begin;
    for (const line of text.trim().split('\n')) {
        const words = line.split(' ');
        if (words[0] === 'block') {
            [, block] = words;
            begin = parseInt(words[2], 16);
        } else for (const each of expand(words, begin)) add(pages, block, begin, each);
    }
    return pages;
}

function add(pages, block, begin, register) {
    const page = page_of(register.address);
    if (!pages.has(page)) pages.set(page, { block, begin, registers: new Map() });
    pages.get(page).registers.set(register.address, register);
}

function expand([name, ...numbers], begin) {
    const [offset, reset, writable, clears, count, distance] = numbers.map((word) =>
        word.startsWith('x') ? parseInt(word.slice(1), 10) : parseInt(word, 16),
    );
    return Array.from({ length: count ?? 1 }, (_, i) => ({
        name: name.replace('*', i),
        address: begin + offset + i * (distance ?? 0),
        reset: Number.isNaN(reset) ? undefined : reset,
        writable,
        clears,
    }));
}

export const register_pages = parse(register_facts);

/// Which registers a block has, and which bits of them are written or cleared, by offset in words.
/// `more` has by offset bits where a write does something that the vendor's table omits.
export class RegisterMasks {
    constructor(begin, more = {}) {
        const page = page_of(begin);
        this.exists = new Uint8Array(page_size / 4);
        this.written = new Uint32Array(page_size / 4);
        for (const { address, writable, clears } of register_pages.get(page).registers.values()) {
            const offset = address - page;
            this.exists[offset >>> 2] = 1;
            this.written[offset >>> 2] = writable | clears | (more[offset] ?? 0);
        }
    }
}

/// The values after reset, by offset.
export function reset_values(begin, given = {}) {
    const values = {};
    for (const { address, reset } of register_pages.get(begin).registers.values())
        values[address - begin] = given[address - begin] ?? reset ?? 0;
    return values;
}

/// A block whose registers keep what is written, but nothing else. `given` has by offset what is
/// there instead of the value after reset; the registers `without` are not modelled.
export class PlainRegisters {
    constructor(begin, { given = {}, without = [] } = {}) {
        this.begin = begin;
        this.given = given;
        this.without = without;
        this.page = register_pages.get(begin);
        this.reset();
    }

    reset() {
        this.values = reset_values(this.begin, this.given);
    }

    check(offset) {
        if (this.without.includes(offset))
            fault(`${this.page.block}'s register ${hex(offset)} is not modelled`);
    }

    read(offset) {
        this.check(offset);
        return this.values[offset];
    }

    write(offset, value, raw) {
        this.check(offset);
        const { writable, clears } = this.page.registers.get(this.begin + offset);
        const before = this.values[offset];
        this.values[offset] = ((before & ~writable & ~(raw & clears)) | (value & writable)) >>> 0;
    }
}
