// SPDX-License-Identifier: BSD-3-Clause
// What the firmware takes of the processor, counted without the emulator's cycles: by which
// instructions are executed, what objdump says they are, and what they cost by the Cortex-M0+
// Technical Reference Manual (DDI 0484), table 3-1. Each load and store counts with two cycles,
// though some take one, so what is found is not too low.
//
// usage: processor_load.mjs IMAGE.uf2 IMAGE.elf [OBJDUMP]
import { execFileSync } from 'node:child_process';

import { check, check_within, finish } from './check.mjs';
import { busy_rig } from './rig.mjs';

const [image, symbols, objdump = 'arm-none-eabi-objdump'] = process.argv.slice(2);
const exception_entry = 15;
const exception_exit = 12;

/// Registers of a list as objdump writes it: {r4, r5, pc}.
const listed = (operands) => /\{(.*)\}/.exec(operands)[1].split(',').length;

/// Cycles of an instruction; of one that branches, when it does.
function cost(mnemonic, operands) {
    const name = mnemonic.replace(/\.[nw]$/, '');
    if (/^(ldmia|stmia|push)$/.test(name)) return 1 + listed(operands);
    if (name === 'pop') return (operands.includes('pc') ? 3 : 1) + listed(operands);
    if (/^(ldr|str)/.test(name)) return 2;
    if (/^(bl|msr|mrs|dmb|dsb|isb)$/.test(name)) return 3;
    if (/^(bx|blx|wfi|wfe)$/.test(name) || /^(mov|add)$/.test(name) && /^pc,/.test(operands))
        return 2;
    if (/^b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?$/.test(name)) return 2;
    return 1;
}

/// What is at each address: {cycles, passed} if it branches, or not.
function disassemble() {
    const instructions = new Map();
    const text = execFileSync(objdump, ['-d', '--no-show-raw-insn', symbols], {
        encoding: 'utf8',
        maxBuffer: 1 << 28,
    });
    for (const line of text.split('\n')) {
        const found = /^\s*([0-9a-f]+):\s+([a-z0-9.]+)\s*([^;@]*)/.exec(line);
        if (found === null) continue;
        const [, address, mnemonic, operands] = found;
        const cycles = cost(mnemonic, operands.trim());
        const conditional = /^b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)/.test(mnemonic);
        instructions.set(parseInt(address, 16), { cycles, passed: conditional ? 1 : cycles });
    }
    return instructions;
}

/// Counts from here on; `total` and `thread` grow, the latter by what no interrupt did.
function count(machine, instructions) {
    const { processor, interrupts } = machine;
    const counted = { total: 0, thread: 0, unknown: 0 };
    const [begin, end] = [interrupts.begin.bind(interrupts), interrupts.end.bind(interrupts)];
    let entered = false;
    interrupts.begin = (exception) => {
        entered = true;
        counted.total += exception_entry;
        begin(exception);
    };
    interrupts.end = () => {
        counted.total += exception_exit;
        end();
    };
    const step = processor.step.bind(processor);
    processor.step = () => {
        const at = processor.pc;
        const depth = interrupts.active.length;
        entered = false;
        const cycles = step();
        const returned = interrupts.active.length < depth;
        if (entered && !returned && interrupts.active.length > depth) return cycles;
        const instruction = instructions.get(at);
        if (instruction === undefined) {
            ++counted.unknown;
            return cycles;
        }
        const taken = returned || processor.pc !== at + 2;
        const spent = taken ? instruction.cycles : instruction.passed;
        counted.total += spent;
        if (depth === 0) counted.thread += spent;
        return cycles;
    };
    return counted;
}

const rig = busy_rig(image, 1, 152_439);
rig.run_ms(200);
const { machine } = rig;
const [began, slept] = [machine.now, machine.sleep_cycles];
const counted = count(machine, disassemble());
rig.run_ms(400);
const percent = (cycles) => (100 * cycles) / (machine.now - began);
const emulated = percent(machine.now - began - (machine.sleep_cycles - slept));
const [total, thread] = [percent(counted.total), percent(counted.thread)];
console.log(
    `four cameras at 50 Hz, an IMU at 820 Hz: ${total.toFixed(2)} % of the processor, ` +
        `${thread.toFixed(2)} % without interrupts; by the emulator ${emulated.toFixed(2)} %`,
);
check('instructions that objdump does not know', counted.unknown, 0);
check_within('percent of the processor', total, 1, 10);
check_within('percent without interrupts', thread, 1, 8);
check_within('percent by the emulator', emulated, 0.98 * total, 1.02 * total);
finish('processor_load');
