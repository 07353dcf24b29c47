// SPDX-License-Identifier: BSD-3-Clause
// The processor's own registers: interrupt controller, system control and SysTick.
import { fault, hex } from './fault.mjs';

// 26 belong to peripherals; programs may set the others.
const all_lines = 0xffffffff;
const systick_exception = 15;
const pendsv_exception = 14;
const thread_priority = 4; // below each interrupt
const exceptions_before_lines = 16;

const cpuid = 0x410cc601;
const reset_request = 0x05fa0004; // into AIRCR, with its key
const systick_max = 0xffffff;

export const irq = {
    timer: 0,
    pwm: 4,
    usb: 5,
    pio0: 7,
    pio1: 9,
    dma: 11,
    io_bank0: 13,
    spi0: 18,
    uart0: 20,
    i2c0: 23,
};

export class Interrupts {
    constructor(clock) {
        this.clock = clock;
        this.lines = 0;
        this.pending = 0;
        this.enabled = 0;
        this.priorities = new Uint8Array(32);
        this.system_priorities = { [systick_exception]: 0, [pendsv_exception]: 0 };
        this.system_pending = 0; // a bit per exception number
        this.vectors = 0;
        this.control = 0; // SCR
        this.event = false; // for WFE
        this.systick = { control: 0, reload: 0, begin: 0, event: undefined };
        this.active = []; // exceptions, the innermost last
    }

    /// A peripheral asserts or releases its line.
    set_line(number, level) {
        const bit = 1 << number;
        if (level && !(this.lines & bit)) this.set_pending(bit);
        this.lines = level ? this.lines | bit : this.lines & ~bit;
    }

    set_pending(bits) {
        const sends_event = this.control & 0x10; // SEVONPEND
        if (sends_event && bits & ~this.pending) this.event = true;
        this.pending |= bits;
    }

    get may_interrupt() {
        return ((this.pending & this.enabled) | this.system_pending) !== 0;
    }

    priority_of(exception) {
        if (exception >= exceptions_before_lines)
            return this.priorities[exception - exceptions_before_lines];
        return this.system_priorities[exception];
    }

    /// The exception that would preempt what runs now, whatever the mask says; 0: none.
    next() {
        const { active } = this;
        let best =
            active.length > 0 ? this.priority_of(active[active.length - 1]) : thread_priority;
        let found = 0;
        for (const exception of [pendsv_exception, systick_exception])
            if (this.system_pending & (1 << exception) && this.priority_of(exception) < best) {
                best = this.priority_of(exception);
                found = exception;
            }
        let candidates = this.pending & this.enabled;
        while (candidates !== 0) {
            const number = 31 - Math.clz32(candidates & -candidates);
            candidates &= candidates - 1;
            if (this.priorities[number] < best) {
                best = this.priorities[number];
                found = exceptions_before_lines + number;
            }
        }
        return found;
    }

    begin(exception) {
        this.active.push(exception);
        if (exception >= exceptions_before_lines)
            this.pending &= ~(1 << (exception - exceptions_before_lines));
        else this.system_pending &= ~(1 << exception);
    }

    end() {
        const exception = this.active.pop();
        if (exception === undefined) fault('return from an exception that is not active');
        const bit = exception < exceptions_before_lines ? 0 : 1 << (exception - 16);
        if (this.lines & bit) this.pending |= bit;
    }

    read(offset) {
        if (offset >= 0x400 && offset < 0x420) return this.read_priorities(offset - 0x400);
        switch (offset) {
            case 0x010:
                return this.systick.control;
            case 0x014:
                return this.systick.reload;
            case 0x018:
                return this.systick_value();
            case 0x100:
            case 0x180:
                return this.enabled;
            case 0x200:
            case 0x280:
                return this.pending;
            case 0xd00:
                return cpuid;
            case 0xd04:
                return this.read_state();
            case 0xd08:
                return this.vectors;
            case 0xd0c:
                return 0;
            case 0xd10:
                return this.control;
            case 0xd20:
                return (this.system_priorities[14] << 22) | (this.system_priorities[15] << 30);
            case 0xd90:
                return 0x800; // MPU: 8 regions; using them is not modelled
            default:
                return fault(`the processor's register ${hex(offset)} is not modelled (read)`);
        }
    }

    read_state() {
        const running = this.active.length > 0 ? this.active[this.active.length - 1] : 0;
        const found = this.next();
        const pends = this.may_interrupt ? 1 << 22 : 0;
        const system =
            ((this.system_pending >>> 14) & 1) * 2 ** 28 + (this.system_pending >>> 15) * 2 ** 26;
        return running | (found << 12) | pends | system;
    }

    read_priorities(offset) {
        let value = 0;
        for (let i = 0; i < 4; ++i) value |= this.priorities[offset + i] << (8 * i + 6);
        return value;
    }

    write(offset, value) {
        if (offset >= 0x400 && offset < 0x420) {
            for (let i = 0; i < 4; ++i)
                this.priorities[offset - 0x400 + i] = (value >>> (8 * i + 6)) & 3;
            return;
        }
        switch (offset) {
            case 0x010:
                return this.write_systick_control(value);
            case 0x014:
                this.systick.reload = value & systick_max;
                return;
            case 0x018:
                return this.restart_systick();
            case 0x100:
                this.enabled |= value & all_lines;
                return;
            case 0x180:
                this.enabled &= ~value;
                return;
            case 0x200:
                return this.set_pending(value & all_lines);
            case 0x280:
                this.pending &= ~value | (this.lines & ~this.active_lines());
                return;
            case 0xd04:
                return this.write_state(value);
            case 0xd08:
                this.vectors = (value & ~0xff) >>> 0;
                return;
            case 0xd0c:
                if (value === reset_request) this.on_reset_request?.();
                return;
            case 0xd10:
                this.control = value;
                return;
            case 0xd20:
                this.system_priorities[14] = (value >>> 22) & 3;
                this.system_priorities[15] = value >>> 30;
                return;
            default:
                fault(`the processor's register ${hex(offset)} is not modelled (write)`);
        }
    }

    active_lines() {
        return this.active.reduce((bits, n) => (n >= 16 ? bits | (1 << (n - 16)) : bits), 0);
    }

    write_state(value) {
        if (value & (1 << 28)) this.system_pending |= 1 << pendsv_exception;
        if (value & (1 << 27)) this.system_pending &= ~(1 << pendsv_exception);
        if (value & (1 << 26)) this.system_pending |= 1 << systick_exception;
        if (value & (1 << 25)) this.system_pending &= ~(1 << systick_exception);
        if (value >>> 31) fault('NMI is not modelled');
    }

    write_systick_control(value) {
        const { systick } = this;
        if ((value & 1) !== 0 && (value & 4) === 0)
            fault('SysTick by its reference clock is not modelled: set CLKSOURCE');
        const starts = (value & 1) !== 0 && (systick.control & 1) === 0;
        systick.control = value & 7;
        if (starts) this.restart_systick();
        if ((value & 1) === 0) this.clock.cancel(systick.event);
    }

    restart_systick() {
        const { systick, clock } = this;
        clock.cancel(systick.event);
        systick.begin = clock.now;
        if (!(systick.control & 1) || systick.reload === 0) return;
        systick.event = clock.after(systick.reload + 1, () => {
            if (systick.control & 2) this.system_pending |= 1 << systick_exception;
            this.restart_systick();
        });
    }

    systick_value() {
        const { systick, clock } = this;
        if (!(systick.control & 1) || systick.reload === 0) return 0;
        return (
            (systick.reload - (clock.now - systick.begin) + systick.reload + 1) %
            (systick.reload + 1)
        );
    }
}
