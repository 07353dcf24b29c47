// SPDX-License-Identifier: BSD-3-Clause
// Which functions take the cycles while `measured` is set: by their own instructions, and with what
// they call.
import { ram_begin } from './chip.mjs';

export class Profile {
    constructor(image, core) {
        const { names, map } = image.function_map();
        this.names = names;
        this.map = map;
        this.self = new Float64Array(names.length);
        this.total = new Float64Array(names.length);
        this.calls = new Float64Array(names.length);
        this.running = new Uint32Array(names.length); // how often it is on the stack
        this.stack = [];
        this.now = 0;
        this.back = -1; // where the topmost call returns to
        this.measured = false;
        core.blTaken = () => this.enter(core);
    }

    function_at(address) {
        return this.map[(address - ram_begin) >>> 1];
    }

    enter(core) {
        const called = this.function_at(core.PC & ~1);
        this.stack.push({ called, back: this.back, stack: this.top, began: this.now });
        this.back = core.LR & ~1;
        this.top = core.SP;
        if (called < 0) return;
        ++this.running[called];
        if (this.measured) ++this.calls[called];
    }

    /// After the instruction at `address`; this many of its cycles are the core's.
    step(address, cycles, core) {
        if (this.measured && cycles > 0) {
            this.now += cycles;
            const running = this.function_at(address);
            if (running >= 0) this.self[running] += cycles;
        }
        while (core.PC === this.back && core.SP === this.top) this.leave();
    }

    leave() {
        const { called, back, stack, began } = this.stack.pop();
        this.back = back;
        this.top = stack;
        // A function that calls itself is counted by its outermost call.
        if (called >= 0 && --this.running[called] === 0) this.total[called] += this.now - began;
    }

    functions() {
        return this.names
            .map((name, index) => ({
                name,
                self: this.self[index],
                total: this.total[index],
                calls: this.calls[index],
            }))
            .filter(({ self }) => self > 0);
    }
}
