// SPDX-License-Identifier: BSD-3-Clause
// Tiny programs for tests of the machine: assembled for RAM, and PIO instructions by name.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

const stack = 0x20040000;

/// Bytes for RAM of ARM assembly: a vector table, then `text`. `handlers` has the labels of
/// interrupt handlers by number of the interrupt.
export function assemble(text, handlers = {}) {
    const folder = mkdtempSync(join(tmpdir(), 'program-'));
    const vectors = Array.from({ length: 48 }, (_, i) => {
        if (i === 0) return `.word ${stack}`;
        if (i === 1) return '.word start + 1';
        return `.word ${handlers[i - 16] === undefined ? 0 : `${handlers[i - 16]} + 1`}`;
    });
    const source = `.syntax unified\n.cpu cortex-m0plus\n.thumb\n${vectors.join('\n')}\n${text}\n`;
    try {
        const file = (name) => join(folder, name);
        writeFileSync(file('p.s'), source);
        execFileSync('arm-none-eabi-as', ['-mthumb', file('p.s'), '-o', file('p.o')]);
        execFileSync('arm-none-eabi-ld', [
            '-Ttext=0x20000000',
            '-e',
            '0',
            file('p.o'),
            '-o',
            file('p'),
        ]);
        execFileSync('arm-none-eabi-objcopy', ['-O', 'binary', file('p'), file('b')]);
        return readFileSync(file('b'));
    } finally {
        rmSync(folder, { recursive: true });
    }
}

const layout =
    'SECTIONS { . = 0x20000000; .all : { KEEP(*(.vectors)) *(.text*) *(.rodata*) ' +
    '*(.data*) *(.bss*) } }';

/// Bytes for RAM of a C program, whose section .vectors has its vector table.
export function compile(source) {
    const folder = mkdtempSync(join(tmpdir(), 'program-'));
    try {
        const file = (name) => join(folder, name);
        writeFileSync(file('p.ld'), layout);
        execFileSync('arm-none-eabi-gcc', [
            '-mcpu=cortex-m0plus',
            '-mthumb',
            '-Os',
            '-ffreestanding',
            '-nostdlib',
            '-fno-tree-loop-distribute-patterns',
            '-Wall',
            '-Wextra',
            '-Werror',
            '-T',
            file('p.ld'),
            source,
            '-o',
            file('p'),
            '-lgcc',
        ]);
        execFileSync('arm-none-eabi-objcopy', ['-O', 'binary', file('p'), file('b')]);
        return readFileSync(file('b'));
    } finally {
        rmSync(folder, { recursive: true });
    }
}

const conditions = ['', '!x', 'x--', '!y', 'y--', 'x!=y', 'pin', '!osre'];
const in_sources = { pins: 0, x: 1, y: 2, null: 3, isr: 6, osr: 7 };
const out_targets = { pins: 0, x: 1, y: 2, null: 3, pindirs: 4, pc: 5, isr: 6, exec: 7 };
const mov_targets = { pins: 0, x: 1, y: 2, exec: 4, pc: 5, isr: 6, osr: 7 };
const mov_sources = { pins: 0, x: 1, y: 2, null: 3, status: 5, isr: 6, osr: 7 };
const set_targets = { pins: 0, x: 1, y: 2, pindirs: 4 };

/// PIO instructions; `extra` is the field of delay and side-set.
export const pio = {
    jmp: (condition, address, extra = 0) =>
        (conditions.indexOf(condition) << 5) | address | (extra << 8),
    wait: (level, source, index, extra = 0) =>
        0x2000 |
        (level << 7) |
        (['gpio', 'pin', 'irq'].indexOf(source) << 5) |
        index |
        (extra << 8),
    in: (source, count, extra = 0) =>
        0x4000 | (in_sources[source] << 5) | (count & 31) | (extra << 8),
    out: (target, count, extra = 0) =>
        0x6000 | (out_targets[target] << 5) | (count & 31) | (extra << 8),
    push: ({ block = true, iffull = false } = {}, extra = 0) =>
        0x8000 | (iffull ? 0x40 : 0) | (block ? 0x20 : 0) | (extra << 8),
    pull: ({ block = true, ifempty = false } = {}, extra = 0) =>
        0x8080 | (ifempty ? 0x40 : 0) | (block ? 0x20 : 0) | (extra << 8),
    mov: (target, source, operation = 0, extra = 0) =>
        0xa000 | (mov_targets[target] << 5) | (operation << 3) | mov_sources[source] | (extra << 8),
    irq: (number, { clear = false, wait = false } = {}, extra = 0) =>
        0xc000 | (clear ? 0x40 : 0) | (wait ? 0x20 : 0) | number | (extra << 8),
    set: (target, value, extra = 0) => 0xe000 | (set_targets[target] << 5) | value | (extra << 8),
};
