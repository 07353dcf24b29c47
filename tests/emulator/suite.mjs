// SPDX-License-Identifier: BSD-3-Clause
// Named tests of the firmware's image, each with what it measured.
//
// usage of a program that calls run(): PROGRAM.mjs IMAGE.uf2 IMAGE.elf [NAME...]
// NAME: part of a test's name
import process from 'node:process';

export const [image, symbols, ...names] = process.argv.slice(2);

export function check(condition, what) {
    if (!condition) throw new Error(what);
}

/// Extremes of what the test measured, by what it was.
let measured = {};

export function check_within(value, least, most, what) {
    const [lowest, highest] = measured[what] ?? [value, value];
    measured[what] = [Math.min(lowest, value), Math.max(highest, value)];
    check(value >= least && value <= most, `${what}: ${value}, not from ${least} to ${most}`);
}

/// Runs the tests, functions by their names.
export function run(tests) {
    let failed = 0;
    for (const [name, test] of Object.entries(tests)) {
        if (names.length > 0 && !names.some((part) => name.includes(part))) continue;
        measured = {};
        try {
            test();
            const figures = Object.entries(measured).map(([what, [lowest, highest]]) =>
                `    ${what}: ${lowest.toFixed(1)} to ${highest.toFixed(1)}\n`,
            );
            process.stdout.write(`ok: ${name}\n${figures.join('')}`);
        } catch (error) {
            ++failed;
            process.stdout.write(`FAILED: ${name}: ${error.stack}\n`);
        }
    }
    process.exitCode = failed === 0 ? 0 : 1;
}
