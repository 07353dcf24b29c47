// SPDX-License-Identifier: BSD-3-Clause
// TIMER: 64 bits of microseconds from the crystal's tick, and four alarms on the low 32 bits. An
// alarm comes when the timer reaches its time, never before.
import { fault, hex } from './fault.mjs';
import { irq } from './interrupts.mjs';

const cycles_per_us = 125;
const alarm_count = 4;
const low_range = 2 ** 32;

export class Timer {
    /// `tick`: whether the watchdog's tick runs at 1 MHz.
    constructor(clock, interrupts, tick) {
        this.clock = clock;
        this.interrupts = interrupts;
        this.tick = tick;
        this.alarms = Array.from({ length: alarm_count }, () => ({ target: 0, armed: false }));
        this.reset();
    }

    reset() {
        this.begin = undefined; // the cycle at which the timer was zero; undefined: it stands
        this.standing = 0;
        this.paused = false;
        this.debug_pause = 7;
        this.latched_high = 0;
        this.written_low = 0;
        this.raised = 0;
        this.enable = 0;
        this.force = 0;
        for (const alarm of this.alarms) this.disarm(alarm);
        this.update_lines();
        this.run_or_stand();
    }

    get now_us() {
        if (this.begin === undefined) return this.standing;
        return Math.floor((this.clock.now - this.begin) / cycles_per_us);
    }

    /// The tick, the reset or the pause changed.
    run_or_stand() {
        const us = this.now_us;
        const runs = !this.paused && this.tick.runs;
        this.standing = us;
        this.begin = runs ? this.clock.now - us * cycles_per_us : undefined;
        for (const alarm of this.alarms) if (alarm.armed) this.arm(alarm, alarm.target);
    }

    disarm(alarm) {
        this.clock.cancel(alarm.event);
        alarm.armed = false;
    }

    arm(alarm, target) {
        this.disarm(alarm);
        alarm.target = target;
        alarm.armed = true;
        if (this.begin === undefined) return;
        const us = this.now_us;
        const wait = (target - (us % low_range) + low_range) % low_range || low_range;
        alarm.event = this.clock.at(this.begin + (us + wait) * cycles_per_us, () => {
            alarm.armed = false;
            this.raised |= 1 << this.alarms.indexOf(alarm);
            this.update_lines();
        });
    }

    update_lines() {
        const status = (this.raised & this.enable) | this.force;
        for (let i = 0; i < alarm_count; ++i)
            this.interrupts.set_line(irq.timer + i, ((status >>> i) & 1) === 1);
    }

    read(offset) {
        if (offset >= 0x10 && offset < 0x20) return this.alarms[(offset - 0x10) >>> 2].target;
        const us = this.now_us;
        switch (offset) {
            case 0x08:
                return this.latched_high;
            case 0x0c:
                this.latched_high = Math.floor(us / low_range);
                return us % low_range;
            case 0x20:
                return this.alarms.reduce((bits, { armed }, i) => bits | ((armed ? 1 : 0) << i), 0);
            case 0x24:
                return Math.floor(us / low_range);
            case 0x28:
                return us % low_range;
            case 0x2c:
                return this.debug_pause;
            case 0x30:
                return this.paused ? 1 : 0;
            case 0x34:
                return this.raised;
            case 0x38:
                return this.enable;
            case 0x3c:
                return this.force;
            case 0x40:
                return (this.raised & this.enable) | this.force;
            default:
                return fault(`TIMER's register ${hex(offset)} cannot be read`);
        }
    }

    write(offset, value, raw) {
        if (offset >= 0x10 && offset < 0x20)
            return this.arm(this.alarms[(offset - 0x10) >>> 2], value);
        switch (offset) {
            case 0x00:
                return this.set(value * low_range + this.written_low);
            case 0x04:
                this.written_low = value;
                return;
            case 0x20:
                this.alarms.forEach((alarm, i) => (raw >>> i) & 1 && this.disarm(alarm));
                return;
            case 0x2c:
                this.debug_pause = value | 1; // pauses under the debugger only
                return;
            case 0x30:
                this.paused = (value & 1) === 1;
                return this.run_or_stand();
            case 0x34:
                this.raised &= ~raw;
                return this.update_lines();
            case 0x38:
                this.enable = value & 0xf;
                return this.update_lines();
            case 0x3c:
                this.force = value & 0xf;
                return this.update_lines();
            default:
                fault(`TIMER's register ${hex(offset)} cannot be written`);
        }
    }

    set(us) {
        this.standing = us;
        this.begin = undefined;
        this.run_or_stand();
    }
}
