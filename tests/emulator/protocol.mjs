// SPDX-License-Identifier: BSD-3-Clause
// The host's end of the wire protocol, written from docs/contracts/wire-protocol.md alone.

const header_size = 12;
const crc_size = 4;

const crc_table = Uint32Array.from({ length: 256 }, (_, byte) => {
    let crc = byte;
    for (let bit = 0; bit < 8; ++bit) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
    return crc;
});

export function crc32(bytes) {
    let crc = 0xffffffff;
    for (const byte of bytes) crc = crc_table[(crc ^ byte) & 0xff] ^ (crc >>> 8);
    return ~crc >>> 0;
}

export function cobs_encode(bytes) {
    const out = [0];
    let code = 0;
    for (const byte of bytes) {
        if (byte !== 0) out.push(byte);
        if (byte === 0 || out.length - code === 255) {
            out[code] = out.length - code;
            code = out.length;
            out.push(0);
        }
    }
    out[code] = out.length - code;
    return out;
}

export function cobs_decode(bytes) {
    const out = [];
    for (let at = 0; at < bytes.length; ) {
        const code = bytes[at];
        if (code === 0 || at + code > bytes.length) return undefined;
        out.push(...bytes.slice(at + 1, at + code));
        at += code;
        if (code < 255 && at < bytes.length) out.push(0);
    }
    return out;
}

const stamp = (view, at) => Number(view.getBigInt64(at, true));
const text = (view, at, size) => {
    const bytes = new Uint8Array(view.buffer, view.byteOffset + at, size);
    return String.fromCharCode(...bytes).replace(/\0+$/, '');
};

const readers = {
    0x01: (v) => ({ kind: 'hello', major: v.getUint8(0), cameras: v.getUint8(2),
        reset_cause: v.getUint8(3), time: stamp(v, 8), present: v.getUint32(16, true),
        fastest_imu: v.getUint32(20, true), serial: text(v, 24, 16), firmware: text(v, 40, 16) }),
    0x02: (v) => ({ kind: 'exposure', camera: v.getUint8(0), flags: v.getUint16(2, true),
        trigger: Number(v.getBigUint64(8, true)), tick: Number(v.getBigUint64(16, true)),
        triggered: stamp(v, 24), start: stamp(v, 32), end: stamp(v, 40) }),
    0x03: (v) => ({ kind: 'imu', part: v.getUint8(0), port: v.getUint8(1),
        flags: v.getUint16(2, true), number: v.getUint32(4, true), time: stamp(v, 8),
        gyro: [16, 20, 24].map((at) => v.getInt32(at, true)),
        accel: [28, 32, 36].map((at) => v.getInt32(at, true)) }),
    0x04: (v) => ({ kind: 'event', event: v.getUint8(0), source: v.getUint8(1),
        detail: v.getUint16(2, true), sequence: v.getUint32(4, true), time: stamp(v, 8),
        value: stamp(v, 16) }),
    0x05: (v) => ({ kind: 'clock', id: v.getUint32(0, true), received: stamp(v, 8),
        sent: stamp(v, 16) }),
    0x06: (v) => ({ kind: 'health', time: stamp(v, 0), replaced: v.getUint32(8, true),
        late: v.getUint32(44, true), edges_lost: v.getUint32(48, true),
        stamp_test: v.getUint8(89),
        stray: v.getUint32(52, true),
        skipped: v.getUint32(56, true), longest_ns: v.getUint32(72, true) }),
    0x07: (v) => ({ kind: 'log', level: v.getUint8(0), text: text(v, 1, 95) }),
    0x08: (v) => ({ kind: 'answer', id: v.getUint32(0, true), status: v.getUint8(4),
        refusals: v.getUint8(5), origin: stamp(v, 8) }),
    0x09: (v) => ({ kind: 'refusal', part: v.getUint8(4), index: v.getUint8(5),
        field: v.getUint8(6), value: stamp(v, 8), minimum: stamp(v, 16), maximum: stamp(v, 24) }),
    0x0a: (v) => ({ kind: 'follow_up', id: v.getUint32(0, true), sent: stamp(v, 8) }),
};

/// What a camera of a configuration is made of; times in ns.
export const camera_defaults = { flags: 1, rate_uhz: 50_000_000, phase: 0, pulse: 100_000,
    latency: 0, gap: 0, exposure: 3_000_000, max_exposure: 15_000_000, master: 0, glitch: 0 };

export class Host {
    /// `send(bytes)` passes bytes to the board.
    constructor(send) {
        this.send_bytes = send;
        this.sequence = 0;
        this.pending = [];
        this.messages = [];
        this.bad = 0; // packets that do not read
        this.next = undefined; // number of the board's next packet
        this.gaps = 0;
    }

    send(type, payload) {
        const bytes = new Uint8Array(header_size + payload.length);
        const view = new DataView(bytes.buffer);
        bytes[0] = type;
        view.setUint32(4, 0x484f5354, true);
        view.setUint32(8, this.sequence++, true);
        bytes.set(payload, header_size);
        const check = new Uint8Array(crc_size);
        new DataView(check.buffer).setUint32(0, crc32(bytes), true);
        this.send_bytes(Uint8Array.from([...cobs_encode([...bytes, ...check]), 0]));
    }

    hello() {
        this.send_bytes(Uint8Array.of(0));
        this.send(0x81, Uint8Array.of(3, 0, 0, 0));
    }
    start(cameras = 0xf, flags = 0) {
        this.send(0x83, Uint8Array.of(cameras, flags, 0, 0));
    }
    stop(cameras = 0xf) {
        this.send(0x84, Uint8Array.of(cameras, 0, 0, 0));
    }
    ask_time(id) {
        const payload = new Uint8Array(8);
        new DataView(payload.buffer).setUint32(0, id, true);
        this.send(0x85, payload);
    }
    reboot(to_boot_loader) {
        this.send(0x87, Uint8Array.of(0x42, 0x4f, 0x4f, 0x54, to_boot_loader ? 1 : 0, 0, 0, 0));
    }

    /// A time output at the test output; `board` and `pulse` in ns.
    time_output({ board, utc, pace = 0, pulse, baud, sentences, flags }) {
        const payload = new Uint8Array(48);
        const view = new DataView(payload.buffer);
        view.setBigInt64(0, BigInt(board), true);
        view.setBigInt64(8, BigInt(utc), true);
        view.setInt32(16, pace, true);
        view.setUint32(24, pulse, true);
        view.setUint32(28, baud, true);
        view.setUint16(32, 30, true); // s of holdover
        view.setUint16(34, 90, true); // ms from pulse to sentence
        view.setUint8(38, flags);
        view.setUint8(39, sentences);
        payload.set(Buffer.from('GP'), 40);
        this.send(0x89, payload);
    }

    /// `cameras` by their output; `imus` [{kind, options, rate_mhz}]; `light`, `ports`.
    configure({ id = 1, store = false, cameras = {}, imus = [], light = {}, ports = {} }) {
        const payload = new Uint8Array(256);
        const view = new DataView(payload.buffer);
        view.setUint32(0, id, true);
        view.setUint32(4, store ? 1 : 0, true);
        for (const [output, given] of Object.entries(cameras)) {
            const camera = { ...camera_defaults, ...given };
            const at = 8 + 48 * Number(output);
            const { flags, rate_uhz, phase, pulse, latency, gap } = camera;
            [flags, rate_uhz, phase, pulse, latency, gap].forEach((value, index) =>
                view.setUint32(at + 4 * index, value, true));
            view.setBigInt64(at + 24, BigInt(camera.exposure), true);
            view.setBigInt64(at + 32, BigInt(camera.max_exposure), true);
            view.setUint8(at + 40, camera.master);
            view.setUint8(at + 41, camera.glitch);
        }
        imus.forEach((imu, index) => {
            view.setUint8(200 + 8 * index, imu.kind);
            view.setUint8(201 + 8 * index, imu.filter ?? 0);
            view.setUint8(202 + 8 * index, imu.options ?? 0);
            view.setUint32(204 + 8 * index, imu.rate_mhz, true);
        });
        view.setUint8(216, light.cameras ?? 0);
        view.setUint8(217, light.flags ?? 0);
        view.setUint32(220, light.lead ?? 0, true);
        view.setUint32(224, light.longest ?? 0, true);
        view.setUint32(228, light.duty_ppm ?? 0, true);
        view.setUint8(232, ports.inputs ?? 0);
        view.setUint8(234, ports.options ?? 0);
        view.setUint8(235, ports.test ?? 0);
        view.setUint32(236, ports.sync_rate_uhz ?? 0, true);
        view.setUint32(240, ports.pulse ?? 0, true);
        view.setUint32(248, ports.test_rate_mhz ?? 0, true);
        view.setUint8(252, ports.test_output ?? 0);
        this.send(0x82, payload);
    }

    receive(bytes) {
        for (const byte of bytes) {
            if (byte !== 0) this.pending.push(byte);
            else if (this.pending.length > 0) {
                this.take(cobs_decode(this.pending));
                this.pending = [];
            }
        }
    }

    take(packet) {
        const size = packet === undefined ? 0 : packet.length - crc_size;
        const bytes = Uint8Array.from(packet ?? []);
        const view = new DataView(bytes.buffer);
        if (size < header_size || view.getUint32(size, true) !== crc32(bytes.subarray(0, size))) {
            ++this.bad;
            return;
        }
        this.nonce = view.getUint32(4, true);
        const number = view.getUint32(8, true);
        if (this.next !== undefined && number !== this.next) ++this.gaps;
        this.next = (number + 1) >>> 0;
        const read = readers[bytes[0]];
        if (read === undefined) return;
        this.messages.push(read(new DataView(bytes.buffer, header_size, size - header_size)));
    }

    all(kind) {
        return this.messages.filter((message) => message.kind === kind);
    }
    has_event(kind) {
        return this.all('event').some(({ event }) => event === kind);
    }
    last(kind) {
        return this.all(kind).at(-1);
    }
}
