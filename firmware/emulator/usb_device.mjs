// SPDX-License-Identifier: BSD-3-Clause
// The chip's USB controller as a device: registers, its memory, and how it answers the packets of
// a host (usb_host.mjs), which calls it at the instants when packets end.
import { fault, hex } from './fault.mjs';
import { irq } from './interrupts.mjs';

const memory_size = 4096;
const endpoint_count = 16;
const control_begin = 0x80; // of buffer controls
const control_end = 0x100;
const endpoint0_data = 0x100;
const packet_max = 64;

const available = 1 << 10;
const stall = 1 << 11;
const data1 = 1 << 13;
const full = 1 << 15;
const length_mask = 0x3ff;

// Erratum: AVAILABLE crosses to the 48 MHz clock faster than the rest of the word, which must have
// been written so many cycles before it.
const settle_cycles = 12;

const main_enable = 1;
const pull_up = 1 << 16;
const muxing_to_phy = 1;
const muxing_soft_connect = 8;

// SIE_STATUS
const vbus_detected = 1 << 0;
const line_j = 1 << 2;
const suspended = 1 << 4;
const resume = 1 << 11;
const connected = 1 << 16;
const setup_received = 1 << 17;
const trans_complete = 1 << 18;
const bus_reset = 1 << 19;
const crc_error = 1 << 24;
const sequence_error = 2 ** 31;
const cleared_by_writing = 0xff0f0800 | suspended | connected;

const interrupt = {
    trans_complete: 1 << 3,
    buff_status: 1 << 4,
    sequence_error: 1 << 5,
    bus_reset: 1 << 12,
    connection: 1 << 13,
    suspend: 1 << 14,
    resume: 1 << 15,
    setup: 1 << 16,
    sof: 1 << 17,
    stall_or_nak: 1 << 19,
};

export class UsbDevice {
    constructor(clock, interrupts, clocks) {
        this.clock = clock;
        this.interrupts = interrupts;
        this.clocks = clocks;
        this.memory = new Uint8Array(memory_size);
        this.view = new DataView(this.memory.buffer);
        // Writing these bits clears the interrupts of their changes.
        this.also_written = { 0x50: suspended | connected };
        this.host = undefined; // reported by on_attach(is_attached) and on_armed()
        this.written_at = new Float64Array(2 * endpoint_count).fill(-settle_cycles);
        this.reset();
    }

    reset() {
        const was_attached = this.is_attached;
        this.values = {
            0x0: 0,
            0x40: 0,
            0x4c: 0,
            0x68: 0,
            0x6c: 0x100010,
            0x74: 0,
            0x78: 0,
            0x7c: 0,
            0x80: 0,
            0x84: 0x1f1f,
        };
        this.status = 0;
        this.is_idle = false; // the bus is at J
        this.buffers_done = 0;
        this.stalls_or_naks = 0;
        this.aborting = 0;
        this.frame = 0;
        this.sof_seen = false;
        this.hung = undefined;
        this.in_reset = false;
        this.connection_changed = false;
        this.suspend_changed = false;
        this.enable = 0;
        this.force = 0;
        this.update_line();
        if (was_attached) this.host?.on_attach(false);
    }

    get is_attached() {
        const { values } = this;
        if (values === undefined) return false;
        const to_phy = muxing_to_phy | muxing_soft_connect;
        return (
            (values[0x40] & main_enable) !== 0 &&
            (values[0x4c] & pull_up) !== 0 &&
            (values[0x74] & to_phy) === to_phy
        );
    }

    get address() {
        return this.values[0x0] & 0x7f;
    }

    // Memory.

    read_memory(offset) {
        return this.view.getUint32(offset, true);
    }

    write_memory(offset, value, size) {
        const before = this.view.getUint32(offset & ~3, true);
        if (size === 4) this.view.setUint32(offset, value, true);
        else if (size === 2) this.view.setUint16(offset, value, true);
        else this.memory[offset] = value;
        if (offset >= control_begin && offset < control_end)
            this.write_buffer_control(offset & ~3, before);
    }

    write_buffer_control(offset, before) {
        const word = this.view.getUint32(offset, true);
        const index = (offset - control_begin) >>> 2;
        const changed = (word ^ before) >>> 0;
        const armed = word & ~before & (available | (available << 16));
        const others = changed & ~(available | (available << 16));
        const { now } = this.clock;
        if (others !== 0) {
            if (armed) this.fail_erratum(index, 'together with');
            this.written_at[index] = now;
        }
        if (armed && now - this.written_at[index] < settle_cycles)
            this.fail_erratum(index, `${now - this.written_at[index]} cycles after`);
        if (word & (available << 16)) fault('USB: double buffers are not modelled');
        if (armed) this.host?.on_armed();
    }

    fail_erratum(index, when) {
        const side = index & 1 ? 'OUT' : 'IN';
        fault(
            `USB: AVAILABLE of endpoint ${index >>> 1} ${side} is written ${when} the rest of ` +
                `the word, not ${settle_cycles} cycles later, ${this.clock.where?.() ?? ''}`,
        );
    }

    control_offset(endpoint, is_in) {
        return control_begin + 8 * endpoint + (is_in ? 0 : 4);
    }
    buffer_control(endpoint, is_in) {
        return this.view.getUint32(this.control_offset(endpoint, is_in), true);
    }

    /// The endpoint's control word; endpoint 0 has its own in SIE_CTRL.
    endpoint_control(endpoint, is_in) {
        if (endpoint === 0) return (this.values[0x4c] & 0x60000000) | endpoint0_data | (2 ** 31);
        return this.view.getUint32(8 * endpoint + (is_in ? 0 : 4), true);
    }

    // Registers.

    read(offset) {
        if (offset in this.values) return this.values[offset];
        switch (offset) {
            case 0x48:
                this.sof_seen = false;
                this.update_line();
                return this.frame;
            case 0x50:
                return (this.status | (this.is_idle ? line_j : 0)) >>> 0;
            case 0x58:
                return this.buffers_done;
            case 0x5c:
                return 0;
            case 0x60:
                return this.aborting;
            case 0x64:
                return this.aborting;
            case 0x70:
                return this.stalls_or_naks;
            case 0x8c:
                return this.raw_interrupts();
            case 0x90:
                return this.enable;
            case 0x94:
                return this.force;
            case 0x98:
                return (this.raw_interrupts() & this.enable) | this.force;
            default:
                return fault(`USB's register ${hex(offset)} is not modelled (read)`);
        }
    }

    write(offset, value, raw) {
        switch (offset) {
            case 0x50:
                this.clear_status(raw);
                break;
            case 0x58:
                this.buffers_done &= ~raw;
                break;
            case 0x60:
                this.aborting = value;
                break;
            case 0x64:
                break;
            case 0x70:
                this.stalls_or_naks &= ~raw;
                break;
            case 0x90:
                this.enable = value & 0xfffff;
                break;
            case 0x94:
                this.force = value & 0xfffff;
                break;
            default:
                this.write_value(offset, value);
        }
        this.update_line();
    }

    write_value(offset, value) {
        if (!(offset in this.values)) fault(`USB's register ${hex(offset)} is not modelled`);
        const was_attached = this.is_attached;
        this.values[offset] = value;
        if (offset === 0x40 && value & 2) fault('USB: host mode is not modelled');
        if (offset === 0x40 && value & 1 && !this.clocks.usb_runs)
            fault('USB is enabled, but clk_usb does not run at 48 MHz');
        if (offset === 0x78) {
            const detected = (value & 0xc) === 0xc; // VBUS_DETECT by its override
            this.status = detected ? this.status | vbus_detected : this.status & ~vbus_detected;
        }
        if (this.is_attached !== was_attached) {
            this.is_idle = !was_attached; // by its own pull-up
            this.host?.on_attach(!was_attached);
        }
        if (offset === 0x68) this.host?.on_armed();
    }

    clear_status(bits) {
        if (bits & suspended) this.suspend_changed = false;
        if (bits & connected) this.connection_changed = false;
        const kept = this.status & (connected | suspended);
        this.status = (this.status & ~(bits & cleared_by_writing)) | kept;
    }

    raw_interrupts() {
        const { status } = this;
        let raw = 0;
        if (status & trans_complete) raw |= interrupt.trans_complete;
        if (this.buffers_done) raw |= interrupt.buff_status;
        if (status >>> 31) raw |= interrupt.sequence_error;
        if (status & bus_reset) raw |= interrupt.bus_reset;
        if (this.connection_changed) raw |= interrupt.connection;
        if (this.suspend_changed) raw |= interrupt.suspend;
        if (status & resume) raw |= interrupt.resume;
        if (status & setup_received) raw |= interrupt.setup;
        if (this.sof_seen) raw |= interrupt.sof;
        if (this.stalls_or_naks) raw |= interrupt.stall_or_nak;
        return raw;
    }

    update_line() {
        const level = ((this.raw_interrupts() & this.enable) | this.force) !== 0;
        this.interrupts.set_line(irq.usb, level);
    }

    // What the host does, at the ends of packets.

    /// The reset begins; `on_bus_reset_end` ends it.
    on_bus_reset() {
        this.is_idle = false;
        this.in_reset = true;
        this.status |= bus_reset;
        if (!(this.status & connected)) this.connection_changed = true;
        this.status |= connected;
        this.on_suspend(false);
        this.update_line();
    }

    /// Erratum E5: on a bus that does not rest for 800 us then, the controller stays in reset.
    on_bus_reset_end(is_busy) {
        this.is_idle = true;
        this.in_reset = is_busy;
    }

    /// Erratum E15, which only a reset of the controller ends. What else it does then is not
    /// documented: 'deaf', it does not even count frames; 'failed', it does, and reports an error;
    /// 'mute', nothing shows it.
    hang(kind) {
        this.hung = kind;
        if (kind === 'failed') this.status |= crc_error;
    }
    get answers_nothing() {
        return this.in_reset || this.hung !== undefined;
    }

    on_disconnect() {
        this.is_idle = this.is_attached;
        if (this.status & connected) this.connection_changed = true;
        this.status &= ~connected;
        this.update_line();
    }

    on_suspend(is_suspended) {
        const was = (this.status & suspended) !== 0;
        if (was === is_suspended) return;
        this.suspend_changed = true;
        this.status = is_suspended ? this.status | suspended : this.status & ~suspended;
        if (!is_suspended) this.status |= resume;
        this.update_line();
    }

    on_sof(frame) {
        if (this.in_reset || this.hung === 'deaf') return;
        this.frame = frame & 0x7ff;
        this.sof_seen = true;
        this.update_line();
    }

    on_setup(bytes) {
        this.memory.set(bytes, 0);
        this.status |= setup_received;
        this.values[0x68] = 0; // a new request ends the stall
        this.update_line();
    }

    /// What an IN token finds: 'stall', undefined for NAK, or {bytes, is_data1}.
    on_in(endpoint) {
        const word = this.buffer_control(endpoint, true);
        if (this.stalls(endpoint, word, 1)) return 'stall';
        if (!this.is_enabled(endpoint, true)) return undefined;
        if ((word & (available | full)) !== (available | full)) return this.nak(endpoint, true);
        const length = word & length_mask;
        if (length > packet_max) fault(`USB: endpoint ${endpoint} IN sends ${length} bytes`);
        const begin = this.endpoint_control(endpoint, true) & 0xffff & ~0x3f;
        const bytes = this.memory.slice(begin, begin + length);
        return { bytes, is_data1: (word & data1) !== 0 };
    }

    would_send(endpoint) {
        const word = this.buffer_control(endpoint, true);
        if (this.stalls(endpoint, word, 1)) return true;
        const ready = available | full;
        return this.is_enabled(endpoint, true) && (word & ready) === ready;
    }

    would_take(endpoint) {
        const word = this.buffer_control(endpoint, false);
        if (this.stalls(endpoint, word, 2)) return true;
        return this.is_enabled(endpoint, false) && (word & (available | full)) === available;
    }

    stalls(endpoint, word, armed_bit) {
        if (!(word & stall)) return false;
        return endpoint !== 0 || (this.values[0x68] & armed_bit) !== 0;
    }

    is_enabled(endpoint, is_in) {
        return this.endpoint_control(endpoint, is_in) >>> 31 === 1;
    }

    nak(endpoint, is_in) {
        const asked = endpoint !== 0 && (this.endpoint_control(endpoint, is_in) & (1 << 16)) !== 0;
        if (asked) {
            this.stalls_or_naks |= 1 << (2 * endpoint + (is_in ? 0 : 1));
            this.update_line();
        }
        return undefined;
    }

    /// The host acknowledged what `on_in` gave.
    on_in_done(endpoint) {
        const offset = this.control_offset(endpoint, true);
        const word = this.view.getUint32(offset, true) & ~(available | full);
        this.view.setUint32(offset, word, true);
        this.complete(endpoint, true);
    }

    /// What an OUT packet finds: 'stall', 'nak' or 'ack'.
    on_out(endpoint, bytes, is_data1) {
        const word = this.buffer_control(endpoint, false);
        if (this.stalls(endpoint, word, 2)) return 'stall';
        if (!this.would_take(endpoint)) {
            this.nak(endpoint, false);
            return 'nak';
        }
        if (((word & data1) !== 0) !== is_data1) {
            this.status |= sequence_error; // seen as a repetition: acknowledged, not delivered
            this.update_line();
            return 'ack';
        }
        const begin = this.endpoint_control(endpoint, false) & 0xffff & ~0x3f;
        if (bytes.length > (word & length_mask))
            fault(
                `USB: endpoint ${endpoint} OUT has ${word & length_mask} bytes for a packet ` +
                    `of ${bytes.length}`,
            );
        this.memory.set(bytes, begin);
        const done = (word & ~(available | length_mask)) | full | bytes.length;
        this.view.setUint32(this.control_offset(endpoint, false), done, true);
        return 'ack';
    }

    /// A buffer was sent or received and acknowledged.
    complete(endpoint, is_in) {
        const every_buffer = 1 << 29;
        if (this.endpoint_control(endpoint, is_in) & every_buffer)
            this.buffers_done |= 1 << (2 * endpoint + (is_in ? 0 : 1));
        this.status |= trans_complete;
        this.update_line();
    }
}
