// SPDX-License-Identifier: BSD-3-Clause
// Reads UF2: blocks of 512 bytes, each with its address in flash.

const block_size = 512;
const first_magic = 0x0a324655;
const second_magic = 0x9e5d5157;
const last_magic = 0x0ab16f30;
const has_family = 0x2000;
const rp2040_family = 0xe48bff56;
const data_at = 32;

/// Returns [{address, bytes}, ...].
export function read_uf2(bytes) {
    if (bytes.length % block_size !== 0)
        throw new Error(`a UF2 file has ${block_size} bytes per block; this has ${bytes.length}`);
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const segments = [];
    for (let at = 0; at < bytes.length; at += block_size) {
        const word = (offset) => view.getUint32(at + offset, true);
        if (word(0) !== first_magic || word(4) !== second_magic || word(508) !== last_magic)
            throw new Error(`the UF2 block at ${at} has wrong magic words`);
        if (word(8) & has_family && word(28) !== rp2040_family)
            throw new Error(`the UF2 block at ${at} is not for the RP2040`);
        const begin = at + data_at;
        segments.push({ address: word(12), bytes: bytes.subarray(begin, begin + word(16)) });
    }
    return segments;
}

export const is_uf2 = (bytes) =>
    bytes.length >= 4 &&
    new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true) === first_magic;
