// SPDX-License-Identifier: BSD-3-Clause
// Single-cycle registers: GPIO by the processor, divider, spin locks. There is one core only.
import { fault, hex } from './fault.mjs';
import { pin_count } from './pins.mjs';

const all_pins = 2 ** pin_count - 1;

// The divider has its result this many cycles after its last operand; a program that reads earlier
// gets a wrong one on the chip, so it is a fault.
const divider_cycles = 8;

/// How a register of the four at each output changes.
function changed(kind, before, value) {
    return [value, before | value, before & ~value, before ^ value][kind];
}

export class Sio {
    constructor(clock, pins, flash) {
        this.clock = clock;
        this.pins = pins;
        this.flash = flash;
        this.out = 0;
        this.enable = 0;
        this.high_out = 0;
        this.high_enable = 0;
        this.locks = 0;
        this.divider = {
            dividend: 0,
            divisor: 0,
            quotient: 0,
            remainder: 0,
            ready_at: 0,
            dirty: 0,
        };
    }

    read(offset) {
        if (offset >= 0x100 && offset < 0x180) return this.take_lock((offset - 0x100) >>> 2);
        if (offset >= 0x060 && offset < 0x07c) return this.read_divider(offset);
        switch (offset) {
            case 0x000:
                return 0;
            case 0x004:
                return this.pins.synchronised(this.clock.now);
            case 0x008:
                return 0x3e | ((this.high_enable & 2 ? this.high_out & 2 : 2) >>> 0);
            case 0x010:
            case 0x014:
            case 0x018:
            case 0x01c:
                return this.out;
            case 0x020:
            case 0x024:
            case 0x028:
            case 0x02c:
                return this.enable;
            case 0x050:
                return 2; // the other core's FIFO can be written, and nothing is to be read
            case 0x05c:
                return this.locks;
            default:
                return fault(`SIO's register ${hex(offset)} is not modelled (read)`);
        }
    }

    write(offset, value) {
        const kind = (offset >>> 2) & 3;
        if (offset >= 0x010 && offset < 0x030) {
            if (offset < 0x020) this.out = changed(kind, this.out, value) & all_pins;
            else this.enable = changed(kind, this.enable, value) & all_pins;
            return this.pins.drive();
        }
        if (offset >= 0x100 && offset < 0x180) {
            this.locks &= ~(1 << ((offset - 0x100) >>> 2));
            return;
        }
        if (offset >= 0x060 && offset < 0x07c) return this.write_divider(offset, value);
        if (offset === 0x050) return; // clears what never happens
        fault(`SIO's register ${hex(offset)} is not modelled (write)`);
    }

    take_lock(number) {
        const bit = 1 << number;
        if (this.locks & bit) return 0;
        this.locks |= bit;
        return bit;
    }

    read_divider(offset) {
        const { divider } = this;
        const ready = this.clock.now >= divider.ready_at;
        switch (offset) {
            case 0x060:
            case 0x068:
                return divider.dividend;
            case 0x064:
            case 0x06c:
                return divider.divisor;
            case 0x070:
            case 0x074:
                if (!ready) fault('the divider is read before it is ready');
                if (offset === 0x070) divider.dirty = 0;
                return offset === 0x070 ? divider.quotient : divider.remainder;
            default:
                return (ready ? 1 : 0) | divider.dirty;
        }
    }

    write_divider(offset, value) {
        const { divider } = this;
        divider.dirty = 2;
        if (offset === 0x070) divider.quotient = value;
        else if (offset === 0x074) divider.remainder = value;
        else {
            if (offset === 0x060 || offset === 0x068) divider.dividend = value;
            else divider.divisor = value;
            this.divide(offset >= 0x068);
            divider.ready_at = this.clock.now + divider_cycles;
        }
    }

    divide(is_signed) {
        const { divider } = this;
        const dividend = is_signed ? divider.dividend | 0 : divider.dividend;
        const divisor = is_signed ? divider.divisor | 0 : divider.divisor;
        if (divisor === 0) {
            divider.quotient = is_signed && dividend < 0 ? 1 : 0xffffffff;
            divider.remainder = divider.dividend;
        } else {
            divider.quotient = Math.trunc(dividend / divisor) >>> 0;
            divider.remainder = (dividend % divisor) >>> 0;
        }
    }
}
