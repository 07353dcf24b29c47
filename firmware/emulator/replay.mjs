// SPDX-License-Identifier: BSD-3-Clause
// replay.mjs IMAGE RECORDING RESULT [--profile]: lives a recorded life of the board again on the
// chip's instruction set, and counts the cycles of each poll. Fails when the core does not ask the
// hardware for exactly what was recorded.
import { readFileSync, writeFileSync } from 'node:fs';
import process from 'node:process';

import { Chip, ram_begin, ram_size } from './chip.mjs';
import { Image } from './image.mjs';
import { Profile } from './profile.mjs';
import { Recording } from './recording.mjs';

const poll_again = 1;
const poll_measured = 2;

// Whose the cycles of an instruction are. The library serves both.
const no_code = 0;
const core_code = 1;
const library_code = 2;
const port_code = 3; // replaying stands for the port, whose cycles are not the core's

const all_instructions = 4e9; // more means that the program does not end

function code_map(image) {
    const map = new Uint8Array(ram_size / 2).fill(no_code);
    for (const [name, code] of [
        ['.core', core_code],
        ['.library', library_code],
        ['.replay', port_code],
    ]) {
        const { address, size } = image.section(name);
        map.fill(code, (address - ram_begin) >>> 1, (address - ram_begin + size) >>> 1);
    }
    return map;
}

function replay(image, recorded, with_profile) {
    const cycles = [0]; // of the construction, then of each poll
    let own = 0;
    let over = false;
    let begins = true;
    const recording = new Recording(
        recorded,
        (address) => chip.text(address),
        (mark) => {
            cycles[cycles.length - 1] = own;
            own = 0;
            begins = true;
            over = (mark & poll_again) === 0;
            if (profile !== undefined) profile.measured = (mark & poll_measured) !== 0;
            if (!over) cycles.push(0);
        },
    );
    const chip = new Chip(recording, image.symbol('replay_window').address);
    image.load(chip);
    const constants = image.section('.replay');
    chip.constant_end = constants.address + constants.size;
    const stack_end = image.symbol('bss_end').address;
    const back = ram_begin + ram_size;
    chip.enter(image.entry, image.symbol('stack_top').address, back);
    const profile = with_profile ? new Profile(image, chip.core) : undefined;
    const codes = code_map(image);
    let code = port_code;
    let base = 0;
    let deepest = { bytes: 0, at: 0 };
    let instructions = 0;
    for (; chip.pc !== back; ++instructions) {
        const at = chip.pc;
        const here = codes[(at - ram_begin) >>> 1];
        if (here !== library_code) code = here;
        if (code === core_code) {
            const stack = chip.sp;
            if (begins) {
                base = stack;
                begins = false;
            }
            if (base - stack > deepest.bytes) deepest = { bytes: base - stack, at };
        }
        const taken = chip.step();
        const counted = code === core_code ? taken : 0;
        own += counted;
        if (profile !== undefined) profile.step(at, counted, chip.core);
        if (chip.sp < stack_end) throw new Error(`the stack is full at 0x${at.toString(16)}`);
        if (instructions > all_instructions) throw new Error('the program does not end');
    }
    if (!over) throw new Error('the program ended before the recording');
    const { names, map } = image.function_map();
    return {
        polls: cycles.slice(1), // the first are those of the construction
        stack: deepest.bytes,
        deepest: names[map[(deepest.at - ram_begin) >>> 1]] ?? '',
        core: image.section('.core').size,
        library: image.section('.library').size,
        board: image.symbol('board_storage').size,
        profile: profile?.functions() ?? [],
    };
}

const [image_path, recording_path, result_path, option] = process.argv.slice(2);
try {
    const image = new Image(readFileSync(image_path));
    const result = replay(image, readFileSync(recording_path), option === '--profile');
    writeFileSync(result_path, JSON.stringify(result));
} catch (error) {
    process.stderr.write(`replay: ${error.message}\n`);
    process.exitCode = 1;
}
