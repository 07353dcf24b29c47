// SPDX-License-Identifier: BSD-3-Clause
// The emulated board at the USB of another machine, by the protocol of usb-redir as QEMU speaks it:
//
//   node usb_redirect.mjs IMAGE SOCKET
//
// listens there for one peer, and runs as fast as time goes, if it can. Each line of standard input
// is a command, 'unplug' or 'plug'. Standard output has a line for each thing that happens.
import { readFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { createInterface } from 'node:readline';
import { Fault } from './fault.mjs';
import { Machine } from './machine.mjs';

const cycles_per_ms = 125_000;
/// Between looks at the peer. If lower, it takes more time than the board; if higher, a request
/// waits for a millisecond more.
const slice_ms = 1;
/// A board that is so far behind lets the time go.
const patience_ms = 20;

const packet_max = 64;
const full_speed = 1;
const to_host = 0x80;

const message = {
    hello: 0, connect: 1, disconnect: 2, reset: 3, interfaces: 4, endpoints: 5,
    set_configuration: 6, get_configuration: 7, configuration: 8,
    set_alternate: 9, get_alternate: 10, alternate: 11,
    start_interrupts: 15, stop_interrupts: 16, interrupts: 17, cancel: 21,
    control: 100, bulk: 101,
};
// What QEMU's xHCI asks for: versions of devices, sizes of packets, numbers of messages of 64 bits,
// lengths of 32 bits. Only the first message of each side has a number of 32 bits.
const abilities = (1 << 1) | (1 << 4) | (1 << 5) | (1 << 6);
const hello_size = 12;
const header_size = 16;
const bulk_header_size = 10;

const status = { success: 0, cancelled: 1, invalid: 2, failed: 3, stall: 4 };
const status_of = (result) =>
    typeof result !== 'string' ? status.success
    : result === 'stall' ? status.stall
    : status.failed;

const request = { clear_feature: 1, set_configuration: 9, set_interface: 11 };
const of_interface = 1;
const of_endpoint = 2;

/// Numbers in which the protocol counts endpoints.
const slot_of = (address) => (address & 15) | ((address & to_host) >> 3);

/// What the peer wants to know of the descriptors before it looks at the device.
function describe({ device, configuration }) {
    const endpoints = Buffer.alloc(3 * 32 + 2 * 32);
    const interfaces = Buffer.alloc(4 + 4 * 32);
    endpoints.fill(0xff, 0, 32);
    for (const address of [0, to_host]) {
        endpoints[slot_of(address)] = 0;
        endpoints.writeUInt16LE(packet_max, 96 + 2 * slot_of(address));
    }
    let count = 0;
    for (let at = 0; at < configuration.length; at += configuration[at]) {
        const [, kind, number, , , class_code, subclass, protocol] = configuration.subarray(at);
        if (kind === 4) {
            [number, class_code, subclass, protocol].forEach((value, field) => {
                interfaces[4 + 32 * field + count] = value;
            });
            interfaces.writeUInt32LE(++count);
        }
        if (kind !== 5) continue;
        const slot = slot_of(number);
        endpoints[slot] = configuration[at + 3] & 3;
        endpoints[32 + slot] = configuration[at + 6];
        endpoints[64 + slot] = interfaces[4 + count - 1];
        endpoints.set(configuration.subarray(at + 4, at + 6), 96 + 2 * slot);
    }
    const [class_code, subclass, protocol] = device.subarray(4);
    const numbers = device.subarray(8, 14); // vendor, product, version
    const connect = [full_speed, class_code, subclass, protocol, ...numbers];
    return { interfaces, endpoints, connect };
}

class UsbRedirect {
    constructor(machine, socket) {
        this.host = machine.usb;
        this.socket = socket;
        this.received = Buffer.alloc(0);
        this.waiting = []; // messages that arrived while the device was set up again
        this.reads = []; // of the bulk endpoint: {id, header, wanted, got}
        this.writes = []; // {id, header, packets}
        this.connected = false;
        const version = Buffer.alloc(64);
        version.write('VersaVIS emulator');
        socket.write(Buffer.concat([words(message.hello, 68, 0), version, words(abilities)]));
        const { host } = this;
        host.on_configured = () => this.configured();
        host.on_lost = () => this.lose();
        host.on_bytes = (bytes) => this.take(bytes);
        host.on_written = () => this.written();
        host.on_error = (why) => say(`error ${why}`);
        host.set_reading(false);
        if (host.state === 'configured') this.configured();
    }

    send(type, id, ...parts) {
        const body = Buffer.concat(parts.map((part) => Buffer.from(part)));
        const number = Buffer.from(BigUint64Array.of(BigInt(id)).buffer);
        this.socket.write(Buffer.concat([words(type, body.length), number, body]));
    }

    receive(bytes) {
        this.received = Buffer.concat([this.received, bytes]);
        while (this.received.length >= header_size) {
            const [type, length] = [0, 4].map((at) => this.received.readUInt32LE(at));
            const begin = type === message.hello ? hello_size : header_size;
            if (this.received.length < begin + length) return;
            const id = this.received.readBigUInt64LE(8);
            const body = this.received.subarray(begin, begin + length);
            this.received = this.received.subarray(begin + length);
            if (this.connected) this.waiting.push([type, id, body]);
        }
        this.handle_waiting();
    }

    /// What the peer asked of a device that has left is for nobody; a reset lets it wait.
    handle_waiting() {
        while (this.host.state === 'configured' && this.waiting.length > 0)
            this.handle(...this.waiting.shift());
    }

    /// Our own host has set the device up, for the first time or after a reset.
    configured() {
        if (!this.connected) {
            const { interfaces, endpoints, connect } = describe(this.host.descriptors);
            this.send(message.interfaces, 0, interfaces);
            this.send(message.endpoints, 0, endpoints);
            this.send(message.connect, 0, connect);
            this.connected = true;
            say('plugged');
        }
        this.handle_waiting();
    }

    lose() {
        if (!this.connected) return;
        this.connected = false;
        this.forget(status.failed);
        this.waiting = [];
        this.send(message.disconnect, 0);
        say('gone');
    }

    handle(type, id, body) {
        switch (type) {
            case message.hello:
            case message.stop_interrupts:
                return;
            case message.reset:
                this.forget(status.cancelled);
                return this.host.reset();
            case message.set_configuration:
                return this.configure(id, body[0]);
            case message.get_configuration:
                return this.host.control({ type: to_host, request: 8, length: 1 }, (result) =>
                    this.send(message.configuration, id, [status_of(result), result[0] ?? 0]));
            case message.set_alternate:
                return this.alternate(id, body[0], body[1]);
            case message.get_alternate:
                return this.send(message.alternate, id, [status.success, body[0], 0]);
            case message.start_interrupts:
                return this.send(message.interrupts, id, [status.success, body[0]]);
            case message.cancel:
                return this.cancel(id);
            case message.control:
                return this.pass_control(id, body);
            case message.bulk:
                return this.pass_bulk(id, body);
            default:
                throw new Error(`a message of type ${type} is not known`);
        }
    }

    configure(id, value) {
        const what = { type: 0, request: request.set_configuration, value };
        this.host.control(what, (result) => {
            this.host.in_data1 = this.host.out_data1 = false;
            this.send(message.configuration, id, [status_of(result), value]);
        });
    }

    alternate(id, index, value) {
        const what = { type: of_interface, request: request.set_interface, value, index };
        this.host.control(what, (result) =>
            this.send(message.alternate, id, [status_of(result), index, value]));
    }

    pass_control(id, body) {
        const what = {
            request: body[1], type: body[2],
            value: body.readUInt16LE(4), index: body.readUInt16LE(6), length: body.readUInt16LE(8),
            data: body.subarray(10),
        };
        this.host.control(what, (result) => {
            if (what.type === of_endpoint && what.request === request.clear_feature)
                this.host[what.index & to_host ? 'in_data1' : 'out_data1'] = false;
            const data = typeof result === 'string' || !(what.type & to_host) ? [] : result;
            const header = Buffer.from(body.subarray(0, 10));
            header[3] = status_of(result);
            if (what.type & to_host) header.writeUInt16LE(data.length, 8);
            this.send(message.control, id, header, data);
        });
    }

    pass_bulk(id, body) {
        const header = Buffer.from(body.subarray(0, bulk_header_size));
        const length = header.readUInt16LE(2) | (header.readUInt16LE(8) << 16);
        if (header[0] & to_host) {
            this.reads.push({ id, header, wanted: length, got: [] });
            return this.host.set_reading(true);
        }
        const packets = Math.max(1, Math.ceil(length / packet_max));
        this.writes.push({ id, header, packets });
        this.host.queue(Uint8Array.from(body.subarray(bulk_header_size)), packets);
    }

    end_bulk({ id, header }, result, data = []) {
        header[1] = result;
        if (header[0] & to_host) {
            header.writeUInt16LE(data.length & 0xffff, 2);
            header.writeUInt16LE(data.length >>> 16, 8);
        }
        this.send(message.bulk, id, header, data);
    }

    /// A packet of the device: what asked for it ends with a short one, or when it has all.
    take(bytes) {
        const [read] = this.reads;
        if (read === undefined) return; // it was on its way when the last reader gave up
        read.got.push(...bytes);
        if (bytes.length < packet_max || read.got.length >= read.wanted)
            this.end_bulk(this.reads.shift(), status.success, read.got);
        this.host.set_reading(this.reads.length > 0);
    }

    written() {
        if (--this.writes[0].packets === 0) this.end_bulk(this.writes.shift(), status.success);
    }

    /// What waits for the device to be able is not begun; what it has got is the peer's.
    cancel(id) {
        const read = this.reads.find((one) => one.id === id);
        if (read === undefined) return;
        this.reads = this.reads.filter((one) => one !== read);
        this.end_bulk(read, status.cancelled, read.got);
        this.host.set_reading(this.reads.length > 0);
    }

    forget(result) {
        for (const one of [...this.reads, ...this.writes]) this.end_bulk(one, result);
        this.reads = [];
        this.writes = [];
        this.host.set_reading(false);
    }
}

const words = (...values) => Buffer.from(Uint32Array.from(values).buffer);
const say = (text) => process.stdout.write(`${text}\n`);

function fail(error) {
    console.error(error instanceof Fault ? `the emulated board: ${error.message}` : error);
    process.exit(1);
}

/// Runs the board on the time of this machine until it stops by itself.
function live(machine) {
    let began_ms = performance.now();
    const go_on = () => {
        const due_ms = performance.now() - began_ms - machine.now / cycles_per_ms;
        if (due_ms > patience_ms) began_ms += due_ms - patience_ms;
        if (due_ms < slice_ms) return setTimeout(go_on, slice_ms);
        try {
            const why = machine.run_for(slice_ms * cycles_per_ms);
            if (why !== 'time') {
                machine.usb.on_attach(false);
                return say(`stopped ${why}`);
            }
        } catch (error) {
            fail(error);
        }
        return setImmediate(go_on);
    };
    go_on();
}

const [image, path] = process.argv.slice(2);
const machine = new Machine({ flash: readFileSync(image), ram_only: true });
createServer((socket) => {
    const redirect = new UsbRedirect(machine, socket);
    socket.on('data', (bytes) => {
        try {
            redirect.receive(bytes);
        } catch (error) {
            fail(error);
        }
    });
    socket.on('close', () => process.exit(0));
    socket.on('error', () => process.exit(0));
}).listen(path, () => say('listening'));
createInterface({ input: process.stdin }).on('line', (line) => {
    if (line === 'unplug') {
        machine.usb.disconnect();
        machine.usb.on_lost();
    }
    if (line === 'plug') machine.usb.connect();
});
live(machine);
