// SPDX-License-Identifier: BSD-3-Clause
// DMA: twelve channels that share one path to the bus. A transfer reads and writes at one instant;
// how long the path is taken is about what the chip needs, not exact.
import { fault, hex } from './fault.mjs';
import { irq } from './interrupts.mjs';

const channel_count = 12;
const channel_stride = 0x40;

// From a request to its transfer: the request is synchronised, then read and write go through.
const start_cycles = 4;
// What a transfer keeps the path from the next, and what each side at slow registers adds.
const transfer_cycles = 1;
const slow_cycles = 2;

const unpaced = 63;
const enable = 1 << 0;
const high_priority = 1 << 1;
const incr_read = 1 << 4;
const incr_write = 1 << 5;
const ring_writes = 1 << 10;
const quiet = 1 << 21;
const swaps = 1 << 22;
const sniffs = 1 << 23;
const busy = 1 << 24;
const written_bits = 0xffffff;

// What the four words of each alias are, the last of which triggers.
const read_address = 0;
const write_address = 1;
const count = 2;
const control = 3;
const aliases = [
    [read_address, write_address, count, control],
    [control, read_address, write_address, count],
    [control, count, read_address, write_address],
    [control, write_address, count, read_address],
].flat();

class Channel {
    constructor(index) {
        this.index = index;
        this.reset();
    }

    reset() {
        this.control = 0; // also chained to channel 0
        this.read = 0;
        this.write = 0;
        this.reload = 0;
        this.left = 0;
        this.is_busy = false;
    }

    get request() {
        return (this.control >>> 15) & 63;
    }
    get chained_to() {
        return (this.control >>> 11) & 15;
    }
    get size() {
        return 1 << ((this.control >>> 2) & 3);
    }

    advance() {
        const bits = (this.control >>> 6) & 15;
        const ring = (rings, address) => {
            const next = (address + this.size) >>> 0;
            if (bits === 0 || !rings) return next;
            const mask = (1 << bits) - 1;
            return ((address & ~mask) | (next & mask)) >>> 0;
        };
        const { control } = this;
        if (control & incr_read) this.read = ring(!(control & ring_writes), this.read);
        if (control & incr_write) this.write = ring(control & ring_writes, this.write);
        --this.left;
    }
}

export class Dma {
    /// `requests` has, by number, a function that returns whether the peripheral requests a
    /// transfer.
    constructor(clock, bus, interrupts, requests) {
        this.clock = clock;
        this.bus = bus;
        this.interrupts = interrupts;
        this.requests = requests;
        this.channels = Array.from({ length: channel_count }, (_, index) => new Channel(index));
        this.reset();
    }

    reset() {
        this.raised = 0;
        this.enables = [0, 0];
        this.forces = [0, 0];
        this.wanted = 0; // requests of busy channels, as a set of numbers
        this.free_at = 0;
        this.last = 0;
        this.clock.cancel(this.event);
        this.event = undefined;
        for (const channel of this.channels) channel.reset();
        this.listen();
        this.update_lines();
    }

    /// A peripheral's request may have come.
    signal(number) {
        if (this.listening[number] === 1 && this.event === undefined) this.pump();
    }

    listen() {
        this.listening = new Uint8Array(64);
        for (const channel of this.channels)
            if (channel.is_busy) this.listening[channel.request] = 1;
    }

    is_ready(channel) {
        if (!channel.is_busy || !(channel.control & enable)) return false;
        const { request } = channel;
        return request === unpaced || this.requests[request]();
    }

    pump() {
        if (this.event !== undefined || !this.channels.some((c) => this.is_ready(c))) return;
        const at = Math.max(this.clock.now + start_cycles, this.free_at);
        this.event = this.clock.at(at, () => this.transfer());
    }

    /// The next ready channel after the last, those of high priority first.
    choose() {
        let found;
        for (let i = 1; i <= channel_count; ++i) {
            const channel = this.channels[(this.last + i) % channel_count];
            if (!this.is_ready(channel)) continue;
            if (channel.control & high_priority) return channel;
            found ??= channel;
        }
        return found;
    }

    transfer() {
        this.event = undefined;
        const channel = this.choose();
        if (channel === undefined) return;
        this.last = channel.index;
        this.move(channel);
        const slow = (address) => (address >>> 28 === 4 ? slow_cycles : 0);
        const taken = transfer_cycles + slow(channel.read) + slow(channel.write);
        channel.advance();
        this.free_at = this.clock.now + taken;
        if (channel.left === 0) this.finish(channel);
        if (!this.channels.some((c) => this.is_ready(c))) return;
        this.event = this.clock.at(this.free_at, () => this.transfer());
    }

    move({ index, size, control, read, write }) {
        const { bus } = this;
        const { where } = bus;
        bus.where = () => `by DMA channel ${index}, cycle ${this.clock.now}`;
        if (size === 1) bus.write8(write, bus.read8(read));
        else if (size === 2) bus.write16(write, swap(control, bus.read16(read), 2));
        else bus.write32(write, swap(control, bus.read32(read), 4));
        bus.where = where;
    }

    finish(channel) {
        channel.is_busy = false;
        this.listen();
        if (!(channel.control & quiet)) this.raise(channel);
        if (channel.chained_to !== channel.index) this.trigger(this.channels[channel.chained_to]);
    }

    raise(channel) {
        this.raised |= 1 << channel.index;
        this.update_lines();
    }

    trigger(channel) {
        if (channel === undefined || !(channel.control & enable) || channel.is_busy) return;
        if (channel.control & sniffs) fault('DMA: the sniffer is not modelled');
        if (channel.request >= 59 && channel.request < unpaced)
            fault('DMA: the pacing timers are not modelled');
        if (this.requests[channel.request] === undefined && channel.request !== unpaced)
            fault(`DMA: the request ${channel.request} is not modelled`);
        channel.left = channel.reload;
        channel.is_busy = channel.left > 0;
        this.listen();
        this.pump();
    }

    update_lines() {
        for (let i = 0; i < 2; ++i) this.interrupts.set_line(irq.dma + i, this.status(i) !== 0);
    }

    status(which) {
        return (this.raised & this.enables[which]) | this.forces[which];
    }

    read(offset) {
        if (offset < channel_count * channel_stride) return this.read_channel(offset);
        switch (offset) {
            case 0x400:
                return this.raised;
            case 0x404:
            case 0x414:
                return this.enables[offset === 0x404 ? 0 : 1];
            case 0x408:
            case 0x418:
                return this.forces[offset === 0x408 ? 0 : 1];
            case 0x40c:
            case 0x41c:
                return this.status(offset === 0x40c ? 0 : 1);
            case 0x430:
            case 0x444:
                return 0;
            case 0x448:
                return channel_count;
            default:
                return this.read_debug(offset);
        }
    }

    read_debug(offset) {
        const channel = this.channels[(offset - 0x800) >>> 6];
        if (offset >= 0x800 && channel !== undefined && (offset & 0x3f) === 4)
            return channel.reload;
        return fault(`DMA's register ${hex(offset)} is not modelled (read)`);
    }

    read_channel(offset) {
        const channel = this.channels[Math.floor(offset / channel_stride)];
        switch (aliases[(offset & 0x3f) >>> 2]) {
            case read_address:
                return channel.read;
            case write_address:
                return channel.write;
            case count:
                return channel.left;
            default:
                return channel.control | (channel.is_busy ? busy : 0);
        }
    }

    write(offset, value, raw) {
        if (offset < channel_count * channel_stride) return this.write_channel(offset, value);
        switch (offset) {
            case 0x400:
            case 0x40c:
            case 0x41c:
                this.raised &= ~raw;
                break;
            case 0x404:
            case 0x414:
                this.enables[offset === 0x404 ? 0 : 1] = value & 0xffff;
                break;
            case 0x408:
            case 0x418:
                this.forces[offset === 0x408 ? 0 : 1] = value & 0xffff;
                break;
            case 0x430:
                for (const channel of this.channels)
                    if ((value >>> channel.index) & 1) this.trigger(channel);
                break;
            case 0x444:
                this.abort(value);
                break;
            default:
                fault(`DMA's register ${hex(offset)} is not modelled (write)`);
        }
        this.update_lines();
    }

    abort(bits) {
        for (const channel of this.channels)
            if ((bits >>> channel.index) & 1) channel.is_busy = false;
        this.listen();
    }

    write_channel(offset, value) {
        const channel = this.channels[Math.floor(offset / channel_stride)];
        const register = aliases[(offset & 0x3f) >>> 2];
        if (register === read_address) channel.read = value;
        if (register === write_address) channel.write = value;
        if (register === count) channel.reload = value;
        if (register === control) channel.control = value & written_bits;
        if ((offset & 0xf) !== 0xc) {
            if (register === control) this.pump();
            return;
        }
        if (value !== 0) this.trigger(channel);
        else if (channel.control & quiet) this.raise(channel);
    }
}

function swap(control, value, size) {
    if (!(control & swaps)) return value;
    if (size === 2) return ((value & 0xff) << 8) | (value >>> 8);
    return (
        ((value & 0xff) << 24) | ((value & 0xff00) << 8) | ((value >>> 8) & 0xff00) | (value >>> 24)
    );
}
