// SPDX-License-Identifier: BSD-3-Clause
// A USB host at full speed with a driver for CDC-ACM: frames of 1 ms, packets that take their bit
// times, NAK and back-pressure. It finds the device, sets it up and moves bytes.
//
// write(bytes, at), on_bytes = (bytes, cycle) => ..., on_written = (packet, cycle) => ...,
// set_reading(bool): a host that does not read. on_configured, on_error = (text) => ...
// control({ type, request, value, index, length, data }, (result) => ...): bytes, or a text when it
// failed. set_line_coding(baud), set_line_state(dtr, rts), suspend(), resume(), disconnect(),
// connect(), reset(). on_lost = () => ...: the device has left by itself. `state` is 'detached',
// 'attached', 'configured' or 'suspended'; with `logs` set, `log` has each transaction.
// busy_resets: after so many resets, neighbours keep the bus busy. `corrupts`: a packet that ends
// close to the next frame is corrupted, and the device hangs in this way.
import { fault } from './fault.mjs';

// 12 Mbit/s at 125 MHz.
const cycles_per_bit = 125 / 12;
const frame_cycles = 125_000;

// SYNC, PID, fields, CRC and the end of the packet.
const token_bits = 35;
const handshake_bits = 19;
const data_frame_bits = 35; // without the bytes
// Whether the device is ready is decided when a transaction begins.

// Between packets of a transaction; the standard allows 2 to 7.5.
const gap_bits = 4;

// The host tries again so long after a NAK. Real hosts try without a pause or every 125 us; at half
// the wait for a device is half as long.
const retry_cycles = 1000;
// An OUT packet that is refused takes the bus for up to so many of these slots.
const slots_of_out = 8;

const suspended_after_ms = 3;
const corrupted_cycles = 12_500; // at the end of a frame

// From the pull-up to the reset, and for the reset. The standard asks for 100 and 10 ms.
const debounce_ms = 100;
const reset_ms = 10;
const recovery_ms = 10;
const address_recovery_ms = 2;

const packet_max = 64;
const request_limit_ms = 500; // a device that does not answer for so long is broken

const cycles_of_ms = (ms) => Math.round(ms * 125_000);
const cycles_of_bits = (bits) => Math.round(bits * cycles_per_bit);

/// Bits that are stuffed into `bytes`: a 0 after six 1. Those of PID and CRC are left out.
function stuffed_bits(bytes) {
    let ones = 0;
    let stuffed = 0;
    for (const byte of bytes)
        for (let bit = 0; bit < 8; ++bit) {
            ones = (byte >>> bit) & 1 ? ones + 1 : 0;
            if (ones === 6) {
                ++stuffed;
                ones = 0;
            }
        }
    return stuffed;
}

const data_bits = (bytes) => data_frame_bits + 8 * bytes.length + stuffed_bits(bytes);

export class UsbHost {
    /// `times` may have debounce_ms, reset_ms and recovery_ms.
    constructor(clock, device, { parks = true, times = {} } = {}) {
        this.clock = clock;
        this.device = device;
        this.parks = parks;
        this.times = { debounce_ms, reset_ms, recovery_ms, address_recovery_ms, ...times };
        this.on_bytes = () => {};
        this.on_configured = () => {};
        this.reads = true;
        this.logs = false;
        this.log = [];
        this.plugged = true;
        this.sends_frames = false;
        this.busy_resets = 0;
        this.corrupts = undefined;
        this.clear();
        device.host = this;
    }

    clear() {
        this.state = 'detached';
        this.address = 0;
        this.requests = [];
        this.current = undefined; // the control request under way
        this.outgoing = []; // {bytes, at}
        this.out_data1 = false;
        this.in_data1 = false;
        this.endpoints = undefined;
        this.descriptors = {};
        this.frame = 0;
        this.busy_until = 0;
        this.slot_base = 0; // slots of retry_cycles begin here
        this.slot = undefined; // the event of the next slot
        this.is_held = false; // a transaction is under way
        this.error = undefined;
    }

    // Plugging.

    on_attach(is_attached) {
        if (!this.plugged) return;
        if (is_attached) return this.begin();
        this.lose();
        this.on_lost?.();
    }

    begin() {
        this.state = 'attached';
        this.session = (this.session ?? 0) + 1;
        this.rest();
        this.in_session(cycles_of_ms(this.times.debounce_ms), () => this.reset_bus());
    }

    /// Nothing is on the bus but the device's pull-up.
    rest() {
        this.in_session(cycles_of_ms(suspended_after_ms), () => {
            if (this.device.is_idle && !this.sends_frames) this.device.on_suspend(true);
        });
    }

    lose() {
        this.session = (this.session ?? 0) + 1;
        this.clock.cancel(this.slot);
        this.sends_frames = false;
        this.clear();
    }

    /// Does `action` later, unless the device is lost until then.
    in_session(cycles, action) {
        const { session } = this;
        this.clock.after(cycles, () => session === this.session && action());
    }

    disconnect() {
        this.plugged = false;
        this.lose();
        this.device.on_disconnect();
        this.rest();
    }

    connect() {
        this.plugged = true;
        if (this.device.is_attached) this.begin();
    }

    /// Sets the device up again, as after an error.
    reset() {
        this.lose();
        this.state = 'attached';
        this.reset_bus();
    }

    reset_bus() {
        this.address = 0;
        this.in_data1 = false;
        this.out_data1 = false;
        this.device.on_bus_reset();
        this.in_session(cycles_of_ms(this.times.reset_ms), () => {
            this.device.on_bus_reset_end(this.busy_resets-- > 0);
            this.start_frames();
            this.in_session(cycles_of_ms(this.times.recovery_ms), () => this.enumerate());
        });
    }

    // Frames.

    start_frames() {
        if (this.sends_frames) return;
        this.sends_frames = true;
        this.sof();
    }

    sof() {
        if (!this.sends_frames) return;
        const { now } = this.clock;
        this.frame = (this.frame + 1) & 0x7ff;
        this.next_sof = now + frame_cycles;
        const end = now + cycles_of_bits(token_bits);
        this.in_session(end - now, () => this.device.on_sof(this.frame));
        this.in_session(frame_cycles, () => this.sof());
        const { notify } = this.endpoints ?? {};
        this.polls_interrupt = notify !== undefined && this.device.would_send(notify);
        this.busy_until = end;
        this.slot_base = end;
        this.plan(end);
    }

    suspend() {
        this.sends_frames = false;
        this.clock.cancel(this.slot);
        this.was = this.state;
        this.state = 'suspended';
        this.rest();
    }

    resume() {
        this.in_session(cycles_of_ms(20), () => {
            this.state = this.was;
            this.device.on_suspend(false);
            this.start_frames();
        });
    }

    // When to try what. Slots follow each other by retry_cycles from the last packet that moved
    // something, and the number of a slot decides what is tried in it. So what a slot without
    // effect was does not matter, and it can be left out.

    /// What is tried in a slot: 'setup', 'in', 'out', or undefined.
    kind_of(number) {
        const { current, endpoints, outgoing } = this;
        const is_first = number % slots_of_out === 0;
        if (current !== undefined) {
            if (current.stage === 'setup') return 'setup';
            if (current.takes) return 'in';
            return is_first ? 'out' : undefined;
        }
        if (endpoints === undefined) return undefined;
        if (this.polls_interrupt) return 'in';
        if (outgoing.length === 0) return this.reads ? 'in' : undefined;
        if (is_first) return this.reads ? 'in' : 'out';
        return this.reads && number % slots_of_out === 1 ? 'out' : undefined;
    }

    /// Whether a transaction of this kind would have an effect now.
    would_move(kind) {
        const { device, endpoints, current } = this;
        if (kind === undefined) return false;
        if (kind === 'setup' || !this.parks) return true;
        if (current !== undefined)
            return kind === 'in' ? device.would_send(0) : device.would_take(0);
        if (this.polls_interrupt || this.tells_naks()) return true;
        if (kind === 'in') return device.would_send(endpoints.bulk_in);
        return device.would_take(endpoints.bulk_out);
    }

    plan(cycle) {
        this.clock.cancel(this.slot);
        this.slot = undefined;
        if (!this.sends_frames) return;
        const from = Math.max(cycle, this.busy_until, this.clock.now);
        const first = Math.ceil((from - this.slot_base) / retry_cycles);
        for (let number = first; number < first + slots_of_out; ++number) {
            if (!this.would_move(this.kind_of(number))) continue;
            const at = this.slot_base + number * retry_cycles;
            if (at < this.next_sof) this.slot = this.clock.at(at, () => this.serve(number));
            return;
        }
    }

    /// The device wants to know of NAKs: each has its effect.
    tells_naks() {
        const { device, endpoints } = this;
        const report_bit = 1 << 16;
        return (
            ((device.endpoint_control(endpoints.bulk_in, true) |
                device.endpoint_control(endpoints.bulk_out, false)) &
                report_bit) !==
            0
        );
    }

    on_armed() {
        this.plan_later();
    }

    /// Something may have become possible; it is tried from the next cycle on.
    plan_later() {
        if (!this.is_held) this.plan(this.clock.now + 1);
    }

    serve(number) {
        this.slot = undefined;
        const kind = this.kind_of(number);
        const started = this.try_kind(kind);
        if (!started) this.plan(this.clock.now + 1);
    }

    /// Returns whether a transaction began.
    try_kind(kind) {
        if (kind === undefined) return false;
        if (this.current !== undefined) return this.serve_control();
        if (this.polls_interrupt) {
            this.polls_interrupt = false;
            return this.transact_in(this.endpoints.notify, () => {});
        }
        return kind === 'in' ? this.read_bulk() : this.write_bulk();
    }

    // Transactions. Each ends with `then(result)`; after a NAK the next slot tries again.

    /// Whether a transaction of so many bits still fits into the frame.
    fits(bits) {
        return this.clock.now + cycles_of_bits(bits) < this.next_sof;
    }

    note(kind, endpoint, result, bytes) {
        if (this.logs) this.log.push({ cycle: this.clock.now, kind, endpoint, result, bytes });
    }

    answers() {
        const { device } = this;
        return device.is_attached && !device.answers_nothing && device.address === this.address;
    }

    transact_in(endpoint, then) {
        const most =
            2 * gap_bits + token_bits + data_frame_bits + handshake_bits + 9.4 * packet_max;
        if (!this.fits(most)) return false;
        this.hold(most);
        const ready = this.device.would_send(endpoint);
        this.in_session(cycles_of_bits(token_bits), () => {
            if (!this.answers()) return this.finish_without_answer('in', endpoint, then);
            const found = ready ? this.device.on_in(endpoint) : this.device.nak(endpoint, true);
            if (found === undefined || found === 'stall') {
                this.note('in', endpoint, found ?? 'nak');
                this.release(gap_bits + handshake_bits, found === 'stall');
                if (found === 'stall') then(found);
                return;
            }
            const sent = gap_bits + data_bits(found.bytes);
            this.in_session(cycles_of_bits(sent), () => this.take_in(endpoint, found, then));
        });
        return true;
    }

    take_in(endpoint, found, then) {
        const acknowledged = gap_bits + handshake_bits;
        this.in_session(cycles_of_bits(acknowledged), () => {
            const is_late = this.clock.now > this.next_sof - corrupted_cycles;
            if (this.corrupts !== undefined && endpoint !== 0 && is_late) {
                this.device.hang(this.corrupts);
                return this.finish_without_answer('in', endpoint, then);
            }
            this.device.on_in_done(endpoint);
            this.note('in', endpoint, 'ack', found.bytes);
            this.release(0, true);
            then(found);
            this.plan(this.clock.now);
        });
    }

    transact_out(endpoint, bytes, is_data1, then) {
        const bits = 2 * gap_bits + token_bits + data_bits(bytes) + handshake_bits;
        if (!this.fits(bits)) return false;
        this.hold(bits);
        const sent = token_bits + gap_bits + data_bits(bytes);
        const ready = this.device.would_take(endpoint);
        this.in_session(cycles_of_bits(sent), () => {
            if (!this.answers()) return this.finish_without_answer('out', endpoint, then);
            const result = ready
                ? this.device.on_out(endpoint, bytes, is_data1)
                : (this.device.nak(endpoint, false) ?? 'nak');
            this.in_session(cycles_of_bits(gap_bits + handshake_bits), () => {
                this.note('out', endpoint, result, bytes);
                this.release(0, result !== 'nak');
                if (result === 'ack') this.device.complete(endpoint, false);
                if (result !== 'nak') then(result);
                this.plan(this.clock.now);
            });
        });
        return true;
    }

    hold(bits) {
        this.busy_until = this.clock.now + cycles_of_bits(bits);
        this.is_held = true;
    }

    /// The bus is free after so many bits. Slots start over after a success.
    release(bits, moved) {
        this.busy_until = this.clock.now + cycles_of_bits(bits + gap_bits);
        if (moved) this.slot_base = this.busy_until;
        this.is_held = false;
        if (bits > 0) this.plan(this.busy_until);
    }

    finish_without_answer(kind, endpoint, then) {
        this.note(kind, endpoint, 'silence');
        this.release(gap_bits, true);
        then('silence');
    }

    // Bulk.

    read_bulk() {
        return this.transact_in(this.endpoints.bulk_in, (found) => {
            if (typeof found === 'string') return this.break_off(`bulk IN: ${found}`);
            if (found.is_data1 !== this.in_data1)
                return fault('USB: the device sends the same packet twice (wrong DATA PID)');
            this.in_data1 = !this.in_data1;
            this.on_bytes(found.bytes, this.clock.now);
        });
    }

    write_bulk() {
        const [{ bytes }] = this.outgoing;
        return this.transact_out(this.endpoints.bulk_out, bytes, this.out_data1, (result) => {
            if (result !== 'ack') return this.break_off(`bulk OUT: ${result}`);
            this.out_data1 = !this.out_data1;
            this.outgoing.shift();
            this.on_written?.(bytes, this.clock.now);
        });
    }

    break_off(why) {
        this.error = why;
        this.endpoints = undefined;
        this.on_error?.(why);
    }

    /// Queues `bytes` at the cycle `at`, cut into packets; a last full one is followed by an empty.
    write(bytes, at = this.clock.now) {
        const copy = Uint8Array.from(bytes);
        this.clock.at(Math.max(at, this.clock.now), () =>
            this.queue(copy, Math.floor(copy.length / packet_max) + 1),
        );
    }

    /// Queues so many packets, and only these.
    queue(bytes, packets) {
        for (let i = 0; i < packets; ++i) {
            const packet = bytes.subarray(i * packet_max, (i + 1) * packet_max);
            this.outgoing.push({ bytes: packet, at: this.clock.now });
        }
        this.plan_later();
    }

    set_reading(reads) {
        this.reads = reads;
        this.plan_later();
    }

    // Control requests.

    /// {type, request, value, index, length, data}; `on_end(result)` has bytes, or a text.
    control({ type, request, value = 0, index = 0, length = 0, data = [] }, on_end = () => {}) {
        const bytes = Uint8Array.from(data);
        const setup = new Uint8Array(8);
        const view = new DataView(setup.buffer);
        const takes_data = (type & 0x80) !== 0;
        view.setUint8(0, type);
        view.setUint8(1, request);
        view.setUint16(2, value, true);
        view.setUint16(4, index, true);
        view.setUint16(6, takes_data ? length : bytes.length, true);
        this.requests.push({ setup, takes_data, length, bytes, on_end, got: [] });
        this.next_request();
    }

    next_request() {
        if (this.current !== undefined || this.requests.length === 0) return;
        this.current = this.requests.shift();
        this.current.stage = 'setup';
        const request = this.current;
        this.in_session(cycles_of_ms(request_limit_ms), () => {
            if (this.current === request) this.end_control('no answer in time');
        });
        this.plan_later();
    }

    serve_control() {
        const { current } = this;
        if (current.stage === 'setup')
            return this.transact_setup(current.setup, (result) => this.after_setup(result));
        if (current.takes) return this.transact_in(0, (found) => this.after_in(found));
        const bytes =
            current.stage === 'data'
                ? current.bytes.subarray(current.sent, current.sent + packet_max)
                : new Uint8Array(0);
        return this.transact_out(0, bytes, current.is_data1, (result) =>
            this.after_out(result, bytes),
        );
    }

    transact_setup(setup, then) {
        const bits = 2 * gap_bits + token_bits + data_bits(setup) + handshake_bits;
        if (!this.fits(bits)) return false;
        this.hold(bits);
        const sent = token_bits + gap_bits + data_bits(setup);
        this.in_session(cycles_of_bits(sent), () => {
            if (!this.answers()) return this.finish_without_answer('setup', 0, then);
            this.device.on_setup(setup);
            this.in_session(cycles_of_bits(gap_bits + handshake_bits), () => {
                this.note('setup', 0, 'ack', setup);
                this.release(0, true);
                then('ack');
                this.plan(this.clock.now);
            });
        });
        return true;
    }

    after_setup(result) {
        const { current } = this;
        if (result !== 'ack') return this.end_control(result);
        current.is_data1 = true;
        current.sent = 0;
        if (current.takes_data && current.length > 0) this.to_stage('data', true);
        else if (current.bytes.length > 0) this.to_stage('data', false);
        else this.to_stage('status', true);
    }

    to_stage(stage, takes) {
        this.current.stage = stage;
        this.current.takes = takes;
        if (stage === 'status') this.current.is_data1 = true;
    }

    after_in(found) {
        const { current } = this;
        if (typeof found === 'string') return this.end_control(found);
        if (found.is_data1 !== current.is_data1)
            fault(`USB: wrong DATA PID in the ${current.stage} stage of a control request`);
        if (current.stage === 'status') return this.end_control(Uint8Array.from(current.got));
        current.is_data1 = !current.is_data1;
        current.got.push(...found.bytes);
        const over = found.bytes.length < packet_max || current.got.length >= current.length;
        if (over) this.to_stage('status', false);
    }

    after_out(result, bytes) {
        const { current } = this;
        if (result !== 'ack') return this.end_control(result);
        if (current.stage === 'status') return this.end_control(Uint8Array.from(current.got));
        current.is_data1 = !current.is_data1;
        current.sent += bytes.length;
        if (current.sent >= current.bytes.length) this.to_stage('status', true);
    }

    end_control(result) {
        const { on_end } = this.current;
        this.current = undefined;
        on_end(result);
        this.next_request();
    }

    // Setting the device up.

    descriptor(kind, index, length, then, language = 0) {
        const value = (kind << 8) | index;
        const request = { type: 0x80, request: 6, value, index: language, length };
        this.control(request, (bytes) => {
            if (typeof bytes === 'string')
                return this.break_off(`descriptor ${kind}, ${index}: ${bytes}`);
            then(bytes);
        });
    }

    enumerate() {
        this.descriptor(1, 0, packet_max, (bytes) => {
            if (bytes.length !== 18 || bytes[7] !== packet_max)
                return this.break_off('the device descriptor is wrong');
            this.set_address(1);
        });
    }

    set_address(address) {
        this.control({ type: 0, request: 5, value: address }, (result) => {
            if (typeof result === 'string') return this.break_off(`set address: ${result}`);
            this.in_session(cycles_of_ms(this.times.address_recovery_ms), () => {
                this.address = address;
                this.read_descriptors();
            });
        });
    }

    read_descriptors() {
        const { descriptors } = this;
        this.descriptor(1, 0, 18, (device) => {
            descriptors.device = device;
            this.descriptor(2, 0, 9, (head) => {
                const total = head[2] | (head[3] << 8);
                this.descriptor(2, 0, total, (configuration) => {
                    descriptors.configuration = configuration;
                    this.read_strings([device[14], device[15], device[16]]);
                });
            });
        });
    }

    read_strings(numbers) {
        this.descriptors.strings = [];
        const read_next = () => {
            const number = numbers.shift();
            if (number === undefined) return this.set_configuration();
            if (number === 0) return read_next();
            this.descriptor(
                3,
                number,
                255,
                (bytes) => {
                    const text = Buffer.from(bytes.subarray(2)).toString('utf16le');
                    this.descriptors.strings.push(text);
                    read_next();
                },
                0x409,
            );
        };
        this.descriptor(3, 0, 255, read_next);
    }

    set_configuration() {
        const { configuration } = this.descriptors;
        const found = parse_configuration(configuration);
        this.control({ type: 0, request: 9, value: configuration[5] }, (result) => {
            if (typeof result === 'string') return this.break_off(`set configuration: ${result}`);
            this.endpoints = found;
            this.state = 'configured';
            this.on_configured();
            this.plan(this.clock.now);
        });
    }

    /// The endpoint as descriptors name it.
    clear_halt(endpoint, on_end = () => {}) {
        this.control({ type: 2, request: 1, index: endpoint }, (result) => {
            if (endpoint === (0x80 | this.endpoints.bulk_in)) this.in_data1 = false;
            if (endpoint === this.endpoints.bulk_out) this.out_data1 = false;
            on_end(result);
        });
    }

    // The driver of the serial line.

    set_line_coding(baud, on_end) {
        const data = [...new Uint8Array(Uint32Array.of(baud).buffer), 0, 0, 8];
        const index = this.endpoints.interface_number;
        this.control({ type: 0x21, request: 0x20, index, data }, on_end);
    }

    set_line_state(dtr, rts, on_end) {
        const value = (dtr ? 1 : 0) | (rts ? 2 : 0);
        const index = this.endpoints.interface_number;
        this.control({ type: 0x21, request: 0x22, value, index }, on_end);
    }
}

/// Numbers of the CDC interface and of the endpoints.
function parse_configuration(bytes) {
    const found = {};
    let class_code = 0;
    for (let at = 0; at < bytes.length; at += bytes[at]) {
        if (bytes[at] === 0) fault('USB: a descriptor of length 0 in the configuration');
        if (bytes[at + 1] === 4) {
            class_code = bytes[at + 5];
            if (class_code === 2) found.interface_number = bytes[at + 2];
        }
        if (bytes[at + 1] !== 5) continue;
        const number = bytes[at + 2] & 15;
        if (class_code === 2) found.notify = number;
        if (class_code === 10) found[bytes[at + 2] & 0x80 ? 'bulk_in' : 'bulk_out'] = number;
    }
    for (const name of ['interface_number', 'bulk_in', 'bulk_out'])
        if (found[name] === undefined) fault(`USB: the configuration has no ${name} of CDC`);
    return found;
}
