// SPDX-License-Identifier: BSD-3-Clause
// What ends a run: the program did what the chip would not forgive, or what is not modelled.

export const hex = (value) => `0x${(value >>> 0).toString(16)}`;

export class Fault extends Error {}

export function fault(message) {
    throw new Fault(message);
}
