// SPDX-License-Identifier: BSD-3-Clause
// The flash chip, the serial interface in front of it (XIP_SSI) and the pins between (IO_QSPI).
// Direct mode moves a byte per word; each command lasts from select to deselect. Without each pin
// at its function the flash is not connected: nothing reaches it, and ones are read.
import { fault, hex } from './fault.mjs';

export const flash_size = 2 * 1024 * 1024;
const page_size = 256;
const sector_size = 4096;
const block_size = 65536;
const cycles_per_ms = 125_000;
const default_id = [0xef, 0x40, 0x15];
const default_unique_id = [0xe6, 0x60, 0x58, 0x38, 0x83, 0x12, 0x34, 0x56];

const command = {
    page_program: 0x02,
    read: 0x03,
    write_disable: 0x04,
    status: 0x05,
    write_enable: 0x06,
    fast_read: 0x0b,
    sector_erase: 0x20,
    status2: 0x35,
    unique_id: 0x4b,
    write_status: 0x01,
    jedec_id: 0x9f,
    block_erase: 0xd8,
};

/// A serial NOR flash. `times` may have erase_ms, block_erase_ms and program_ms.
export class FlashChip {
    constructor(
        clock,
        contents,
        { id = default_id, unique_id = default_unique_id, times = {} } = {},
    ) {
        this.clock = clock;
        this.bytes = contents;
        this.id = id;
        this.unique_id = unique_id;
        this.times = { erase_ms: 45, block_erase_ms: 150, program_ms: 0.7, ...times };
        this.work = undefined; // {kind, address, bytes, begin, end}
        this.write_enabled = false;
        this.selected = false;
        this.received = [];
        this.operations = []; // what was erased and programmed, for tests
    }

    get is_busy() {
        if (this.work !== undefined && this.clock.now >= this.work.end) this.finish();
        return this.work !== undefined;
    }

    select(selected) {
        if (selected === this.selected) return;
        this.selected = selected;
        if (selected) this.received = [];
        else if (this.received.length > 0) this.end_command(this.received);
    }

    /// Takes a byte and returns the one sent meanwhile.
    exchange(byte) {
        if (!this.selected) return 0xff;
        const { received } = this;
        const at = received.length;
        received.push(byte);
        const [code] = received;
        if (this.is_busy && at === 0 && code !== command.status && code !== command.status2)
            fault(`flash: command ${hex(code)} while it erases or programs`);
        return this.answer(code, at);
    }

    answer(code, at) {
        switch (code) {
            case command.status:
                return at > 0 ? (this.is_busy ? 1 : 0) | (this.write_enabled ? 2 : 0) : 0xff;
            case command.status2:
            case command.write_status:
                return 0;
            case command.jedec_id:
                return at > 0 ? this.id[(at - 1) % 3] : 0xff;
            case command.unique_id:
                return at > 4 ? this.unique_id[(at - 5) % 8] : 0xff;
            case command.read:
                return at > 3 ? this.bytes[(this.address + at - 4) % flash_size] : 0xff;
            case command.fast_read:
                return at > 4 ? this.bytes[(this.address + at - 5) % flash_size] : 0xff;
            case command.page_program:
            case command.write_enable:
            case command.write_disable:
            case command.sector_erase:
            case command.block_erase:
                return 0xff;
            default:
                return fault(`flash: command ${hex(code)} is not modelled`);
        }
    }

    get address() {
        const [, high, middle, low] = this.received;
        return ((high << 16) | (middle << 8) | low) % flash_size;
    }

    end_command(received) {
        switch (received[0]) {
            case command.write_enable:
                this.write_enabled = true;
                return;
            case command.write_disable:
                this.write_enabled = false;
                return;
            case command.page_program:
                return this.begin(
                    'program',
                    this.address,
                    this.times.program_ms,
                    received.slice(4),
                );
            case command.sector_erase:
                return this.begin_erase(sector_size, this.times.erase_ms);
            case command.block_erase:
                return this.begin_erase(block_size, this.times.block_erase_ms);
        }
    }

    begin_erase(size, ms) {
        const address = this.address - (this.address % size);
        this.begin('erase', address, ms, new Array(size).fill(0xff));
    }

    begin(kind, address, ms, bytes) {
        if (!this.write_enabled) fault(`flash: ${kind} at ${hex(address)} without write enable`);
        if (bytes.length === 0) fault(`flash: ${kind} at ${hex(address)} of nothing`);
        if (bytes.length > page_size && kind === 'program')
            fault(
                `flash: ${bytes.length} bytes are programmed at once into a page of ${page_size}`,
            );
        const { now } = this.clock;
        this.work = { kind, address, bytes, begin: now, end: now + Math.round(ms * cycles_per_ms) };
        this.operations.push({ kind, address, size: bytes.length, cycle: now });
    }

    finish() {
        const { work } = this;
        this.work = undefined;
        this.write_enabled = false;
        apply(this.bytes, work, work.bytes.length);
    }

    /// The contents as a cut of the power now leaves them: what is under way is done in part, and
    /// the byte that it reached is half done.
    cut_power() {
        const left = Uint8Array.from(this.bytes);
        if (!this.is_busy) return Uint8Array.from(this.bytes);
        const { work } = this;
        const part = (this.clock.now - work.begin) / (work.end - work.begin);
        const done = Math.floor(part * work.bytes.length);
        apply(left, work, done);
        const at = place(work, done);
        const wanted = work.kind === 'erase' ? 0xff : left[at] & work.bytes[done];
        left[at] = work.kind === 'erase' ? left[at] | 0x55 : left[at] & (wanted | 0x55);
        return left;
    }
}

/// Where byte number `index` of the work goes: programming wraps within its page.
function place(work, index) {
    if (work.kind === 'erase') return work.address + index;
    const page = work.address - (work.address % page_size);
    return page + ((work.address + index) % page_size);
}

function apply(bytes, work, count) {
    for (let i = 0; i < count; ++i) {
        const at = place(work, i);
        bytes[at] = work.kind === 'erase' ? 0xff : bytes[at] & work.bytes[i];
    }
}

// CTRLR0 as the boot ROM leaves it: reads by command, as the window needs it.
const after_boot = 0x001f0300;
const reads_by_command = 0x300;

const fifo_depth = 16;
const select_low = 2 << 8; // OUTOVER of SS
const select_high = 3 << 8;
const select_mask = 3 << 8;

const qspi_pins = 6;
const select_pin = 1;
const function_mask = 0x1f;
const function_xip = 0;
const function_none = 0x1f;

/// The interface's registers.
export class Ssi {
    constructor(clock, chip) {
        this.clock = clock;
        this.chip = chip;
        this.received = [];
        this.busy_until = 0;
        this.values = {
            0x00: after_boot,
            0x04: 0,
            0x08: 1,
            0x10: 1,
            0x14: 0,
            0x18: 0,
            0x1c: 0,
            0x2c: 0,
            0x4c: 0,
            0x50: 0,
            0x54: 0,
            0xf0: 0,
            0xf4: 0x03000000,
            0xf8: 0,
        };
        this.override = 0;
        this.is_connected = false;
    }

    get is_direct() {
        return (this.override & select_mask) !== 0;
    }

    read(offset) {
        if (offset === 0x60) return this.take();
        if (offset in this.values) return this.values[offset];
        const count = this.received.length;
        switch (offset) {
            case 0x20:
                return this.clock.now < this.busy_until ? fifo_depth : 0;
            case 0x24:
                return count;
            case 0x28: {
                const busy = this.clock.now < this.busy_until ? 1 : 0;
                return busy | 2 | (busy ? 0 : 4) | (count > 0 && !busy ? 8 : 0);
            }
            case 0x58:
                return 0x51535049;
            case 0x5c:
                return 0x3430312a;
            default:
                return fault(`XIP_SSI's register ${hex(offset)} is not modelled (read)`);
        }
    }

    write(offset, value) {
        if (offset === 0x60) return this.send(value);
        if (!(offset in this.values))
            fault(`XIP_SSI's register ${hex(offset)} is not modelled (write)`);
        if ((offset === 0x00 || offset === 0x14) && this.values[0x08] & 1)
            fault(`XIP_SSI's register ${hex(offset)} is written while it is enabled`);
        this.values[offset] = value;
        if (offset === 0x08 && !(value & 1)) this.received = [];
    }

    /// Without an override of the chip select, it lasts while bytes are in the FIFO.
    send(value) {
        if (!(this.values[0x08] & 1)) fault('XIP_SSI is written while it is disabled');
        const bits = ((this.values[0x00] >>> 16) & 31) + 1;
        if (bits !== 8) fault(`XIP_SSI sends ${bits} bits per word; only 8 are modelled`);
        if (!this.is_direct && this.clock.now >= this.busy_until) this.chip.select(false);
        if (!this.is_direct) this.chip.select(this.is_connected);
        if (this.received.length >= fifo_depth) fault("XIP_SSI's receive FIFO overflows");
        this.received.push(this.is_connected ? this.chip.exchange(value & 0xff) : 0xff);
        const cycles = 8 * this.values[0x14];
        this.busy_until = Math.max(this.busy_until, this.clock.now) + cycles;
    }

    /// What arrives is there when all that was sent is through.
    take() {
        if (this.clock.now < this.busy_until || this.received.length === 0)
            fault("XIP_SSI's data register is read before something is there: look at SR.RFNE");
        return this.received.shift();
    }

    write_select(override, is_connected) {
        this.override = override;
        this.is_connected = is_connected;
        const kind = override & select_mask;
        if (!is_connected) this.chip.select(false);
        else if (kind === select_low) this.chip.select(true);
        else if (kind === select_high || this.clock.now >= this.busy_until) this.chip.select(false);
    }

    /// A read through the processor's window.
    read_mapped(offset) {
        if (offset >= flash_size) fault(`read of flash at ${hex(offset)}, behind its end`);
        if (!this.is_connected) return 0xffffffff;
        if (this.chip.is_busy) fault('flash is read while it erases or programs');
        const reads = (this.values[0x00] & reads_by_command) === reads_by_command;
        if (!reads || !(this.values[0x08] & 1))
            fault('flash is read through its window, but XIP_SSI is not set up for that');
        if (this.is_direct)
            fault('flash is read through its window while its select is overridden');
        return new DataView(this.chip.bytes.buffer, this.chip.bytes.byteOffset).getUint32(
            offset,
            true,
        );
    }
}

/// IO_QSPI: the function and the overrides of the flash's pins; SS is the second.
export class QspiIo {
    constructor(ssi) {
        this.ssi = ssi;
        this.controls = new Uint32Array(qspi_pins);
        this.connect();
    }

    /// As the boot ROM leaves the pins: given to the flash.
    connect() {
        this.give(function_xip);
    }

    reset() {
        this.give(function_none);
    }

    give(number) {
        this.controls.fill(number);
        this.notify();
    }

    notify() {
        const is_connected = this.controls.every((c) => (c & function_mask) === function_xip);
        this.ssi.write_select(this.controls[select_pin], is_connected);
    }

    read(offset) {
        if (offset < 8 * qspi_pins) return offset & 4 ? this.controls[offset >>> 3] : 0;
        return fault(`IO_QSPI's register ${hex(offset)} is not modelled (read)`);
    }

    write(offset, value) {
        if (offset >= 8 * qspi_pins)
            fault(`IO_QSPI's register ${hex(offset)} is not modelled (write)`);
        this.controls[offset >>> 3] = value;
        this.notify();
    }
}
