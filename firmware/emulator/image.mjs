// SPDX-License-Identifier: BSD-3-Clause
// A linked program: what is to be loaded where, and what its sections and symbols are.
import { ram_begin, ram_size } from './chip.mjs';

const program_header_size = 32;
const section_header_size = 40;
const symbol_size = 16;
const loaded = 1; // type of a program header
const symbol_table = 2; // type of a section
const function_symbol = 2;

export class Image {
    /// `bytes` of a 32-bit little-endian ELF file.
    constructor(bytes) {
        this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
        this.bytes = bytes;
        if (this.word(0) !== 0x464c457f) throw new Error('the image is no ELF file');
        this.entry = this.word(24);
        this.segments = this.headers(this.word(28), this.half(44), program_header_size)
            .filter((at) => this.word(at) === loaded)
            .map((at) => ({
                offset: this.word(at + 4),
                address: this.word(at + 8),
                physical: this.word(at + 12), // where it lies in flash
                size: this.word(at + 16),
            }));
        this.read_sections();
    }

    half(at) {
        return this.view.getUint16(at, true);
    }
    word(at) {
        return this.view.getUint32(at, true);
    }
    text(at) {
        return this.bytes.toString('latin1', at, this.bytes.indexOf(0, at));
    }
    headers(begin, count, size) {
        return Array.from({ length: count }, (_, index) => begin + index * size);
    }

    read_sections() {
        const headers = this.headers(this.word(32), this.half(48), section_header_size);
        const names = this.word(headers[this.half(50)] + 16);
        this.sections = new Map(
            headers.map((at) => [
                this.text(names + this.word(at)),
                { address: this.word(at + 12), size: this.word(at + 20) },
            ]),
        );
        const table = headers.find((at) => this.word(at + 4) === symbol_table);
        const texts = this.word(headers[this.word(table + 24)] + 16);
        const count = this.word(table + 20) / symbol_size;
        this.symbols = this.headers(this.word(table + 16), count, symbol_size).map((at) => ({
            name: this.text(texts + this.word(at)),
            address: this.word(at + 4),
            size: this.word(at + 8),
            is_function: (this.bytes[at + 12] & 0xf) === function_symbol,
        }));
    }

    section(name) {
        const found = this.sections.get(name);
        if (found === undefined) throw new Error(`the image has no section ${name}`);
        return found;
    }

    symbol(name) {
        const found = this.symbols.find((symbol) => symbol.name === name);
        if (found === undefined) throw new Error(`the image has no symbol ${name}`);
        return found;
    }

    /// Functions by the index of the half-word in RAM; -1 before the first. One without a size
    /// extends to the next.
    function_map() {
        const functions = this.symbols
            .filter((symbol) => symbol.is_function)
            .sort((a, b) => a.address - b.address);
        const map = new Int32Array(ram_size / 2).fill(-1);
        functions.forEach((symbol, index) => map.fill(index, (symbol.address - ram_begin) >>> 1));
        return { names: functions.map((symbol) => symbol.name), map };
    }

    /// [{address, bytes}, ...] of what is programmed into the chip.
    programmed() {
        return this.segments
            .filter(({ size }) => size > 0)
            .map(({ offset, physical, size }) => ({
                address: physical,
                bytes: this.bytes.subarray(offset, offset + size),
            }));
    }

    load(chip) {
        for (const { offset, address, size } of this.segments)
            chip.load(address, this.bytes.subarray(offset, offset + size));
    }
}
