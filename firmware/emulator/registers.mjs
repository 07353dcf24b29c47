// SPDX-License-Identifier: BSD-3-Clause
// Blocks of the chip that the program sets up but that do nothing of interest here.
import { fault, hex } from './fault.mjs';

/// A block whose registers keep what is written, but nothing else. `defaults` has each register
/// that exists, by offset.
export class PlainRegisters {
    constructor(name, defaults, constants = {}) {
        this.name = name;
        this.defaults = defaults;
        this.constants = constants;
        this.reset();
    }

    reset() {
        this.values = { ...this.defaults };
    }

    read(offset) {
        if (offset in this.constants) return this.constants[offset];
        if (offset in this.values) return this.values[offset];
        return fault(`${this.name} has no register ${hex(offset)} (read)`);
    }

    write(offset, value) {
        if (offset in this.values) this.values[offset] = value;
        else if (!(offset in this.constants))
            fault(`${this.name} has no register ${hex(offset)} (write)`);
    }
}

/// Registers `begin`, `begin` + 4, ... up to `end`, all zero.
export function zeroes(begin, end) {
    const values = {};
    for (let offset = begin; offset <= end; offset += 4) values[offset] = 0;
    return values;
}
