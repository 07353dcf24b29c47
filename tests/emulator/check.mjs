// SPDX-License-Identifier: BSD-3-Clause
// Counts what holds and what does not, for tests that run to their end.
import process from 'node:process';

let failures = 0;
let checks = 0;

export function check(what, found, expected) {
    ++checks;
    const [left, right] = [JSON.stringify(found), JSON.stringify(expected)];
    if (left === right) return;
    ++failures;
    console.error(`${what}: ${left}, not ${right}`);
}

export function check_within(what, found, least, most) {
    ++checks;
    if (found >= least && found <= most) return;
    ++failures;
    console.error(`${what}: ${found}, not ${least} to ${most}`);
}

/// `action` must end with a fault that says `words`.
export function check_fault(what, words, action) {
    ++checks;
    try {
        action();
    } catch (error) {
        if (error.message.includes(words)) return;
        ++failures;
        console.error(`${what}: the fault says '${error.message}', not '${words}'`);
        return;
    }
    ++failures;
    console.error(`${what}: no fault`);
}

export function finish(name) {
    console.log(`${name}: ${checks} checks, ${failures} failed`);
    process.exitCode = failures === 0 && checks > 0 ? 0 : 1;
}
