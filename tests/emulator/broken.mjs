// SPDX-License-Identifier: BSD-3-Clause
// Images of the firmware with one fault each are caught by the tests of the firmware.
//
// usage: broken.mjs FAULTS.json FOLDER NAME     FOLDER/NAME/versavis.uf2 is the image of the fault
import { spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import process from 'node:process';
import { fileURLToPath } from 'node:url';
import { check, finish } from './check.mjs';

const [faults, folder, name] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
const programs = ['firmware.mjs', 'pads.mjs'].map((name) => join(here, name));

/// Ends a run that hangs: none takes 5 s of processor time.
const longest_run_ms = 60_000;

/// The output of one test on this image.
function output_of(image, test) {
    const program = programs.find((path) => readFileSync(path, 'utf8').includes(`'${test}`));
    const { stdout, signal } = spawnSync(
        process.execPath,
        [...process.execArgv, program, `${image}.uf2`, `${image}.elf`, test],
        { encoding: 'utf8', timeout: longest_run_ms, killSignal: 'SIGKILL' },
    );
    return signal === null ? stdout : `killed after ${longest_run_ms} ms: ${stdout}`;
}

/// Whether the test fails on this image, and how.
function failure_of(image, test) {
    const output = output_of(image, test);
    const lines = output.split('\n');
    return lines.find((line) => line.startsWith(`FAILED: ${test}`)) ?? `no failure: ${output}`;
}

const { caught_by } = JSON.parse(readFileSync(faults, 'utf8'))[name];
for (const [test, words] of Object.entries(caught_by)) {
    const failure = failure_of(join(folder, name, 'versavis'), test);
    const is_caught = failure.startsWith('FAILED') && failure.includes(words);
    check(`${name}: '${test}' fails by '${words}' (${failure})`, is_caught, true);
}
finish(name);
