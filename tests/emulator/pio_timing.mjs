// SPDX-License-Identifier: BSD-3-Clause
// Holds the PIO of the machine against a model of its own, which goes cycle by cycle after the
// datasheet and knows nothing of parking: random programs with random inputs, FIFO accesses and
// dividers must drive the same levels in the same cycles and leave the same words and flags.
import process from 'node:process';

import { Clock } from './clock.mjs';
import { Pins, pin_function } from './pins.mjs';
import { Pio } from './pio.mjs';
import { pio as code } from './program.mjs';

const machine_count = 2;
const driven_pins = 8; // GPIO 0 to 7 belong to the PIO
const input_pins = 4; // GPIO 8 to 11 come from outside
const run_cycles = 1500;
const first_cycle = 10; // when the machines start

let random_state = 1;
function random(range) {
    random_state = (Math.imul(random_state, 1664525) + 1013904223) >>> 0;
    return Math.floor((random_state / 2 ** 32) * range);
}
const pick = (list) => list[random(list.length)];
const chance = (percent) => random(100) < percent;

// The model.

const rotate = (word, bits) =>
    Number((((BigInt(word) << 32n) | BigInt(word)) >> BigInt(bits)) & 0xffffffffn);

class ModelMachine {
    constructor(owner, index, setup) {
        Object.assign(this, { owner, index, ...setup });
        Object.assign(this, { x: 0, y: 0, isr: 0, osr: 0, isc: 0, osc: 32, pc: 0, wait: 0 });
        this.tx = [];
        this.rx = [];
        this.ticks = 0;
        this.forced = undefined;
        this.pushing = false;
        this.raised = false;
    }

    /// One cycle, `t` cycles after the start.
    cycle(t) {
        if (Math.floor((this.ticks * this.divider) / 256) !== t) return;
        ++this.ticks;
        const opcode = this.forced ?? this.owner.program[this.pc];
        const touches_osr =
            [3].includes(opcode >> 13) ||
            (opcode >> 13 === 4 && opcode & 0x80) ||
            (opcode >> 13 === 5 && ((opcode >> 5) & 7) === 7);
        const refills = this.autopull && this.osc >= this.pull_at && this.tx.length > 0;
        if (this.wait > 0) --this.wait;
        else {
            this.instruction(opcode);
            if (touches_osr) return;
        }
        if (refills) this.refill();
    }

    refill() {
        this.osr = this.tx.shift();
        this.osc = 0;
    }

    instruction(opcode) {
        const was_forced = this.forced !== undefined;
        this.jump = undefined;
        this.follows = undefined;
        const completed = this.effect(opcode >> 13, opcode & 0xff);
        const delay = this.side((opcode >> 8) & 31);
        if (!completed) return;
        if (this.jump !== undefined) this.pc = this.jump;
        else if (!was_forced)
            this.pc = this.pc === this.wrap_top ? this.wrap_bottom : (this.pc + 1) % 32;
        this.forced = this.follows;
        this.wait = this.follows === undefined ? delay : 0;
    }

    side(field) {
        const bits = this.side_count;
        const delay = field % 2 ** (5 - bits);
        let value = field >> (5 - bits);
        let pins = bits;
        if (this.side_optional && bits > 0) {
            if (value < 2 ** (bits - 1)) return delay;
            value -= 2 ** (bits - 1);
            --pins;
        }
        for (let i = 0; i < pins; ++i)
            this.owner.put_out((this.side_base + i) % 32, (value >> i) & 1);
        return delay;
    }

    pins_word() {
        return rotate(this.owner.seen(), this.in_base);
    }

    value_of(source) {
        switch (source) {
            case 0:
                return this.pins_word();
            case 1:
                return this.x;
            case 2:
                return this.y;
            case 3:
                return 0;
            case 5:
                return this.tx.length < this.status_n ? 0xffffffff : 0;
            case 6:
                return this.isr;
            case 7:
                return this.osr;
        }
    }

    put(target, value, count) {
        if (target === 0 || target === 4) {
            for (let i = 0; i < this.out_count; ++i) {
                const pin = (this.out_base + i) % 32;
                const bit = Math.floor(value / 2 ** i) % 2;
                if (target === 0) this.owner.put_out(pin, bit);
                else this.owner.put_dir(pin, bit);
            }
        } else if (target === 1) this.x = value;
        else if (target === 2) this.y = value;
        else if (target === 5) this.jump = value % 32;
        else if (target === 6) {
            this.isr = value;
            this.isc = count;
        } else if (target === 7) this.follows = value % 65536;
    }

    irq_of(number) {
        return number & 16 ? (number & 4) + ((number + this.index) % 4) : number & 7;
    }

    effect(kind, arg) {
        const high = arg >> 5;
        const low = arg & 31;
        return [
            this.do_jmp,
            this.do_wait,
            this.do_in,
            this.do_out,
            this.do_fifo,
            this.do_mov,
            this.do_irq,
            this.do_set,
        ][kind].call(this, high, low, arg);
    }

    do_jmp(condition, address) {
        const { x, y } = this;
        if (condition === 2) this.x = x === 0 ? 0xffffffff : x - 1;
        if (condition === 4) this.y = y === 0 ? 0xffffffff : y - 1;
        const pin = Math.floor(this.owner.seen() / 2 ** this.jmp_pin) % 2 === 1;
        const taken = [
            true,
            x === 0,
            x !== 0,
            y === 0,
            y !== 0,
            x !== y,
            pin,
            this.osc < this.pull_at,
        ];
        if (taken[condition]) this.jump = address;
        return true;
    }

    do_wait(high, index) {
        const level = high >> 2;
        const source = high & 3;
        if (source === 2) {
            const number = this.irq_of(index);
            const is_up = this.owner.flags.has(number);
            if (is_up !== (level === 1)) return false;
            if (level === 1) this.owner.lower.add(number);
            return true;
        }
        const pin = source === 0 ? index : (index + this.in_base) % 32;
        return Math.floor(this.owner.seen() / 2 ** pin) % 2 === level;
    }

    do_in(source, low) {
        const count = low === 0 ? 32 : low;
        if (!this.pushing) {
            const bits = BigInt(this.value_of(source)) % (1n << BigInt(count));
            const before = BigInt(this.isr);
            const after = this.in_right
                ? (before >> BigInt(count)) | (bits << BigInt(32 - count))
                : ((before << BigInt(count)) | bits) & 0xffffffffn;
            this.isr = Number(after);
            this.isc = Math.min(32, this.isc + count);
        }
        if (!this.autopush || this.isc < this.push_at) return true;
        this.pushing = this.rx.length >= this.rx_depth;
        if (this.pushing) return false;
        this.push_isr();
        return true;
    }

    push_isr() {
        this.rx.push(this.isr);
        this.isr = 0;
        this.isc = 0;
    }

    do_out(target, low) {
        const count = low === 0 ? 32 : low;
        if (this.autopull && this.osc >= this.pull_at) {
            if (this.tx.length > 0) this.refill();
            return false;
        }
        const osr = BigInt(this.osr);
        const value = this.out_right ? osr % (1n << BigInt(count)) : osr >> BigInt(32 - count);
        this.osr = Number(
            this.out_right ? osr >> BigInt(count) : (osr << BigInt(count)) & 0xffffffffn,
        );
        this.osc = Math.min(32, this.osc + count);
        this.put(target, Number(value), count);
        if (this.autopull && this.osc >= this.pull_at && this.tx.length > 0) this.refill();
        return true;
    }

    do_fifo(high) {
        const [is_pull, conditional, blocks] = [high >> 2, (high >> 1) & 1, high & 1];
        if (!is_pull) {
            if (conditional && this.isc < this.push_at) return true;
            if (this.rx.length < this.rx_depth) this.push_isr();
            else if (blocks) return false;
            this.isr = 0;
            this.isc = 0;
            return true;
        }
        if ((conditional || this.autopull) && this.osc < this.pull_at) return true;
        if (this.tx.length === 0 && blocks) return false;
        if (this.tx.length > 0) this.refill();
        else {
            this.osr = this.x;
            this.osc = 0;
        }
        return true;
    }

    do_mov(target, low) {
        let value = this.value_of(low & 7);
        if (low >> 3 === 1) value = 0xffffffff - value;
        if (low >> 3 === 2)
            value = parseInt(value.toString(2).padStart(32, '0').split('').reverse().join(''), 2);
        if (target === 7) {
            this.osr = value;
            this.osc = 0;
        } else if (target === 6) {
            this.isr = value;
            this.isc = 0;
        } else if (target === 4) this.follows = value % 65536;
        else this.put(target, value, 32);
        return true;
    }

    do_irq(high, index) {
        const number = this.irq_of(index);
        if (high & 2) {
            this.owner.lower.add(number);
            return true;
        }
        if (!this.raised) this.owner.raise.add(number);
        if (!(high & 1)) return true;
        const over = this.raised && !this.owner.flags.has(number);
        this.raised = !over;
        return over;
    }

    do_set(target, value) {
        if (target === 1) this.x = value;
        else if (target === 2) this.y = value;
        else
            for (let i = 0; i < this.set_count; ++i) {
                const pin = (this.set_base + i) % 32;
                if (target === 0) this.owner.put_out(pin, (value >> i) & 1);
                else this.owner.put_dir(pin, (value >> i) & 1);
            }
        return true;
    }
}

class Model {
    constructor(program, setups, bypass) {
        this.program = program;
        this.bypass = bypass;
        this.out = new Array(32).fill(0);
        this.dir = Array.from({ length: 32 }, (_, pin) => (pin < driven_pins ? 1 : 0));
        this.external = new Array(32).fill(0);
        this.pads = []; // words by cycle
        this.flags = new Set();
        this.machines = setups.map((setup, index) => new ModelMachine(this, index, setup));
        this.log = [];
    }

    put_out(pin, level) {
        this.out[pin] = level;
    }
    put_dir(pin, level) {
        this.dir[pin] = level;
    }
    seen() {
        const direct = this.pads[this.now] & this.bypass;
        return direct + ((this.pads[this.now - 2] ?? 0) & ~this.bypass);
    }

    pad_word() {
        let word = 0;
        for (let pin = 0; pin < 12; ++pin) {
            const level = pin < driven_pins ? this.out[pin] * this.dir[pin] : this.external[pin];
            word += level * 2 ** pin;
        }
        return word;
    }

    /// `stimuli` has, by cycle, what happens to inputs (first) and FIFOs (last).
    run(stimuli) {
        for (this.now = 0; this.now < run_cycles; ++this.now) {
            for (const { pin, level } of stimuli.inputs[this.now] ?? []) this.external[pin] = level;
            this.pads[this.now] = this.pad_word();
            this.raise = new Set();
            this.lower = new Set();
            if (this.now >= first_cycle)
                for (const machine of this.machines) machine.cycle(this.now - first_cycle);
            for (const number of this.lower) this.flags.delete(number);
            for (const number of this.raise) this.flags.add(number);
            this.note();
            for (const access of stimuli.fifos[this.now] ?? []) this.access(access);
        }
    }

    note() {
        const word = (bits) =>
            bits.slice(0, driven_pins).reduce((w, bit, i) => w + bit * 2 ** i, 0);
        const text = `${word(this.out.map((bit, i) => bit * this.dir[i]))}/${word(this.dir)}`;
        if (text === this.last) return;
        this.last = text;
        this.log.push(`${this.now} ${text}`);
    }

    access({ machine, write, word }) {
        const { tx, rx, tx_depth } = this.machines[machine];
        if (!write) rx.shift();
        else if (tx.length < tx_depth) tx.push(word);
    }
}

// Random programs.

const in_names = ['pins', 'x', 'y', 'null', 'isr', 'osr'];

function random_instruction(length) {
    const extra = chance(40) ? random(32) : 0;
    const address = random(length);
    switch (random(13)) {
        case 0:
            return code.wait(random(2), pick(['gpio', 'pin']), 8 + random(input_pins), extra);
        case 1:
            return code.wait(random(2), 'irq', pick([0, 1, 16]), extra);
        case 2:
            return code.in(pick(in_names), 1 + random(32), extra);
        case 3:
        case 4:
            return code.out(
                pick(['pins', 'x', 'y', 'null', 'pindirs', 'isr', 'pins']),
                1 + random(32),
                extra,
            );
        case 5:
            return code.push({ block: chance(50), iffull: chance(30) }, extra);
        case 6:
            return code.pull({ block: chance(50), ifempty: chance(30) }, extra);
        case 7:
            return code.mov(
                pick(['pins', 'x', 'y', 'isr', 'osr']),
                pick(['pins', 'x', 'y', 'null', 'isr', 'osr', 'status']),
                random(3),
                extra,
            );
        case 8:
            return code.irq(pick([0, 1, 16]), { clear: chance(40), wait: chance(20) }, extra);
        case 9:
            return code.set(pick(['pins', 'x', 'y', 'pindirs']), random(32), extra);
        default:
            return code.jmp(
                pick(['', '!x', 'x--', '!y', 'y--', 'x!=y', 'pin', '!osre']),
                address,
                extra,
            );
    }
}

const loops = [
    // A counter with two ticks a round, stamped at the fall of a pin.
    () => [
        code.jmp('x--', 1),
        code.jmp('pin', 0),
        code.mov('isr', 'x', 1),
        code.push({ block: false }),
    ],
    // A change detector.
    () => [
        code.mov('isr', 'null'),
        code.in('pins', 4),
        code.mov('x', 'isr'),
        code.jmp('x!=y', 5),
        code.jmp('', 0),
        code.mov('y', 'x'),
        code.irq(1),
        code.jmp('', 0),
    ],
    // Delays and levels by words.
    () => [code.out('x', 6), code.jmp('x--', 1), code.out('pins', 8)],
    // Routing by the address: each place is its own level.
    () => Array.from({ length: 16 }, (_, i) => code.mov('pc', 'pins', 0, ((i * 5) & 1) << 4)),
    // A counter that begins with zero, and then goes round another way.
    () => [
        code.jmp('x--', 2),
        code.mov('y', 'y'),
        code.jmp('pin', 4),
        code.jmp('', 0),
        code.mov('isr', 'x'),
        code.push({ block: false }),
    ],
    // Pins that another machine may drive, too, again and again.
    () => [code.set('pins', 5), code.jmp('', 0)],
    () => [code.wait(1, 'pin', 1), code.set('pins', 2), code.wait(0, 'pin', 1)],
    // A level that follows an input.
    () => [
        code.wait(1, 'gpio', 9),
        code.set('pins', 31),
        code.wait(0, 'gpio', 9),
        code.set('pins', 0),
    ],
];

function random_setup(length, first) {
    const setup = {
        divider: chance(60) ? 256 : 256 + random(1024),
        autopull: chance(50),
        autopush: chance(30),
        pull_at: chance(50) ? 32 : 1 + random(32),
        push_at: chance(50) ? 32 : 1 + random(32),
        in_right: random(2),
        out_right: random(2),
        side_count: random(4),
        side_base: random(driven_pins),
        side_optional: chance(30) ? 1 : 0,
        set_base: random(driven_pins),
        set_count: random(6),
        out_base: random(driven_pins),
        out_count: random(9),
        in_base: pick([0, 4, 8, 9]),
        jmp_pin: 8 + random(input_pins),
        status_n: random(4),
        wrap_bottom: first,
        wrap_top: first + length - 1,
        join: random(3),
    };
    if (setup.side_count === 0) setup.side_optional = 0;
    setup.tx_depth = [4, 8, 0][setup.join];
    setup.rx_depth = [4, 0, 8][setup.join];
    return setup;
}

function random_case() {
    const program = new Array(32).fill(0);
    const setups = [];
    let first = 0;
    for (let i = 0; i < machine_count; ++i) {
        const known = chance(50) ? pick(loops)() : undefined;
        const length = known?.length ?? 2 + random(8);
        const body = known ?? Array.from({ length }, () => random_instruction(length));
        const shift = (opcode) => (opcode >> 13 === 0 ? opcode + first : opcode);
        body.forEach((opcode, at) => (program[first + at] = shift(opcode)));
        const setup = random_setup(length, first);
        if (known?.length === 16)
            Object.assign(setup, { side_count: 1, side_optional: 0, in_base: 8 });
        setups.push({ ...setup, pc: first });
        first += known?.length === 16 ? 16 : length;
        if (known?.length === 16 && i === 0) break; // jumps to the places 0 to 15
    }
    const bypass = chance(30) ? random(4096) : 0;
    return { program, setups, bypass, stimuli: random_stimuli(setups.length) };
}

function random_stimuli(machines) {
    const inputs = [];
    const fifos = [];
    const add = (list, cycle, entry) => (list[cycle] ??= []).push(entry);
    for (let i = random(60); i > 0; --i)
        add(inputs, random(run_cycles), { pin: 8 + random(input_pins), level: random(2) });
    for (let i = random(60); i > 0; --i)
        add(fifos, random(run_cycles), {
            machine: random(machines),
            write: chance(60),
            word: chance(50) ? random(2 ** 32) : random(256),
        });
    return { inputs, fifos };
}

// The machine's PIO.

class Bench {
    constructor({ program, setups, bypass, stimuli }, parks) {
        this.clock = new Clock();
        const interrupts = { set_line() {} };
        this.pins = new Pins(this.clock, interrupts);
        const { clock, pins } = this;
        this.pio = new Pio({ name: 'pio', clock, pins, interrupts, line: 0, dreq: 0, parks });
        pins.add_source(pin_function.pio0, this.pio);
        for (let gpio = 0; gpio < driven_pins; ++gpio) pins.write_control(gpio, pin_function.pio0);
        pins.watched = 2 ** driven_pins - 1;
        this.pio.enable = 2 ** driven_pins - 1; // most cases start with outputs
        pins.drive();
        program.forEach((opcode, at) => this.pio.write(0x48 + 4 * at, opcode, opcode));
        this.pio.write(0x38, bypass, bypass);
        setups.forEach((setup, index) => this.set_up(index, setup));
        for (let pin = 0; pin < input_pins; ++pin) pins.set_external(8 + pin, 0);
        this.plan(stimuli, setups.length);
    }

    set_up(index, setup) {
        const write = (offset, value) =>
            this.pio.write(0xc8 + 0x18 * index + offset, value >>> 0, value >>> 0);
        write(0x00, setup.divider << 8);
        write(
            0x04,
            (setup.side_optional << 30) |
                (setup.jmp_pin << 24) |
                (setup.wrap_top << 12) |
                (setup.wrap_bottom << 7) |
                setup.status_n,
        );
        write(
            0x08,
            [0, 1, 2][setup.join] * 2 ** 30 +
                ((setup.pull_at & 31) << 25) +
                ((setup.push_at & 31) << 20) +
                (setup.out_right << 19) +
                (setup.in_right << 18) +
                (setup.autopull ? 1 << 17 : 0) +
                (setup.autopush ? 1 << 16 : 0),
        );
        write(
            0x14,
            setup.side_count * 2 ** 29 +
                (setup.set_count << 26) +
                (setup.out_count << 20) +
                (setup.in_base << 15) +
                (setup.side_base << 10) +
                (setup.set_base << 5) +
                setup.out_base,
        );
        write(0x10, setup.pc); // JMP
    }

    plan({ inputs, fifos }, machines) {
        const { clock, pins, pio } = this;
        inputs.forEach((list, cycle) =>
            list.forEach(({ pin, level }) =>
                clock.input_at(cycle, () => pins.set_external(pin, level)),
            ),
        );
        const starts = 2 ** machines - 1;
        clock.at(first_cycle - 1, () => pio.write(0, starts | (starts << 8), 0));
        fifos.forEach((list, cycle) =>
            list.forEach(({ machine, write, word }) =>
                clock.at(cycle, () =>
                    write
                        ? pio.write(0x10 + 4 * machine, word, word)
                        : pio.read(0x20 + 4 * machine),
                ),
            ),
        );
    }

    run() {
        this.clock.settle(run_cycles - 1);
        this.pio.unpark();
        const mask = 2 ** driven_pins - 1;
        const log = [];
        let last = `0/${mask}`;
        for (const { cycle, levels, driven } of this.pins.log) {
            const text = `${levels & mask}/${driven & mask}`;
            if (text !== last) log.push(`${cycle} ${text}`);
            last = text;
        }
        return [`0 0/${mask}`, ...log];
    }
}

function state_of(machines, flags) {
    return machines
        .map(({ x, y, isr, osr, pc, tx, rx }) => [x, y, isr, osr, pc, `t${tx}`, `r${rx}`].join(' '))
        .concat(`flags ${flags}`)
        .join('; ');
}

let failures = 0;
function compare(number, name, found, expected) {
    if (found === expected) return true;
    if (++failures <= 5)
        console.error(`case ${number}, ${name}: found\n${found}\nexpected\n${expected}`);
    return false;
}

let events = 0;
const case_count = Number(process.argv[2] ?? 200);
for (let number = 0; number < case_count; ++number) {
    const picked = random_case();
    const model = new Model(
        picked.program,
        picked.setups.map((setup) => ({ ...setup })),
        picked.bypass,
    );
    model.machines.forEach((machine, i) => (machine.pc = picked.setups[i].pc));
    model.run(picked.stimuli);
    const flags = [...model.flags].reduce((word, bit) => word | (1 << bit), 0);
    events += model.log.length;
    for (const parks of [true, false]) {
        const bench = new Bench(picked, parks);
        const how = parks ? 'parked' : 'stepped';
        const log = bench.run();
        if (!compare(number, `levels, ${how}`, log.join('\n'), model.log.join('\n'))) continue;
        const machines = bench.pio.machines.slice(0, picked.setups.length);
        compare(
            number,
            `state, ${how}`,
            state_of(machines, bench.pio.irq),
            state_of(model.machines, flags),
        );
    }
}
console.log(`${case_count} cases of PIO with ${events} changes of levels, ${failures} failed`);
process.exitCode = failures === 0 && events > 10 * case_count ? 0 : 1;
