// SPDX-License-Identifier: BSD-3-Clause
// One state machine of a PIO block, exact to the cycle. A machine that is stalled, or that runs
// round a loop which nothing can change but an input, is parked: it is not executed until that may
// happen, and then is where it would have been.
import { fault } from './fault.mjs';

const never = Infinity;
const fifo_depth = 4;

// What a stalled machine waits for.
const flows = 0;
const stalled_on_pin = 1;
const stalled_on_tx = 2;
const stalled_on_rx = 3;
const stalled_on_irq = 4;

const sync_cycles = 2;
const one = 256; // the divider's unit

const none = -1;

const mov_isr_x = 0xc1; // and the other way, without the delay
const mov_x_isr = 0x26;

function rotate_left(word, bits) {
    return bits === 0 ? word : (word << bits) | (word >>> (32 - bits));
}

function field_mask(base, count) {
    const mask = count >= 32 ? 0xffffffff : (1 << count) - 1;
    return rotate_left(mask, base) >>> 0;
}

function reversed(word) {
    let result = 0;
    for (let i = 0; i < 32; ++i) result |= ((word >>> i) & 1) << (31 - i);
    return result >>> 0;
}

export class StateMachine {
    constructor(pio, index) {
        this.pio = pio;
        this.index = index;
        this.reset();
    }

    reset() {
        this.enabled = false;
        this.x = 0;
        this.y = 0;
        this.isr = 0;
        this.osr = 0;
        this.pc = 0;
        this.tx = [];
        this.rx = [];
        this.base = 0; // when the divider began
        this.next = never;
        this.left = 0; // ticks of delay that a stopped machine still has to wait
        this.clkdiv = 0x10000;
        this.execctrl = 0x1f000;
        this.shiftctrl = 0xc0000;
        this.pinctrl = 0x14000000;
        this.restart();
        this.decode();
    }

    /// As SM_RESTART does.
    restart() {
        this.isr = 0;
        this.isc = 0;
        this.osc = 32;
        this.exec = none;
        this.stall = flows;
        this.stall_mask = 0;
        this.pushes = false; // an IN has shifted and waits for room
        this.irq_waits = false; // an IRQ WAIT has raised its flag
        this.refill_at = never;
        this.parked = false;
        this.left = 0;
        this.forget_loop();
        this.loop_pc = none;
    }

    decode() {
        const { execctrl, shiftctrl, pinctrl } = this;
        this.divider = this.clkdiv >>> 16 === 0 ? 65536 * one : this.clkdiv >>> 8;
        this.side_enable = (execctrl >>> 30) & 1;
        this.side_to_dirs = (execctrl >>> 29) & 1;
        this.jmp_pin = (execctrl >>> 24) & 31;
        this.wrap_top = (execctrl >>> 12) & 31;
        this.wrap_bottom = (execctrl >>> 7) & 31;
        this.status_rx = (execctrl >>> 4) & 1;
        this.status_level = execctrl & 15;
        this.pull_at = (shiftctrl >>> 25) & 31 || 32;
        this.push_at = (shiftctrl >>> 20) & 31 || 32;
        this.out_right = (shiftctrl >>> 19) & 1;
        this.in_right = (shiftctrl >>> 18) & 1;
        this.autopull = ((shiftctrl >>> 17) & 1) === 1;
        this.autopush = ((shiftctrl >>> 16) & 1) === 1;
        const joins = shiftctrl >>> 30;
        this.tx_depth = [fifo_depth, 2 * fifo_depth, 0, 0][joins];
        this.rx_depth = [fifo_depth, 0, 2 * fifo_depth, 0][joins];
        this.side_count = pinctrl >>> 29;
        this.side_bits = this.side_count - this.side_enable;
        this.side_base = (pinctrl >>> 10) & 31;
        this.side_mask = field_mask(this.side_base, Math.max(this.side_bits, 0));
        this.set_base = (pinctrl >>> 5) & 31;
        this.set_mask = field_mask(this.set_base, (pinctrl >>> 26) & 7);
        this.out_base = pinctrl & 31;
        this.out_mask = field_mask(this.out_base, (pinctrl >>> 20) & 63);
        this.in_base = (pinctrl >>> 15) & 31;
        if (execctrl & 0x60000) fault('PIO: OUT_STICKY and INLINE_OUT_EN are not modelled');
    }

    // The divider's ticks.

    index_at(cycle) {
        if (this.divider === one) return cycle - this.base;
        return Math.ceil(((cycle - this.base) * one) / this.divider);
    }

    cycle_of(index) {
        if (this.divider === one) return this.base + index;
        return this.base + Math.floor((index * this.divider) / one);
    }

    tick_from(cycle) {
        return this.divider === one ? cycle : this.cycle_of(this.index_at(cycle));
    }

    tick_after(cycle, delay) {
        if (this.divider === one) return cycle + 1 + delay;
        return this.cycle_of(this.index_at(cycle) + 1 + delay);
    }

    // Starting and stopping, at the end of the cycle `now`.

    set_enabled(enabled, now) {
        if (enabled === this.enabled) return;
        this.enabled = enabled;
        const first = this.index_at(now + 1);
        if (enabled) {
            this.next = this.cycle_of(first + this.left);
            this.stall = flows;
            this.schedule_refill(now);
        } else {
            this.left = this.next === never ? 0 : Math.max(0, this.index_at(this.next) - first);
            this.next = never;
            this.refill_at = never;
        }
    }

    /// Changes the divider's phase or rate; what is left of a delay stays as many ticks.
    set_divider(value, restarts, now) {
        const { next } = this;
        const left = next === never ? 0 : Math.max(0, this.index_at(next) - this.index_at(now + 1));
        this.clkdiv = value;
        this.decode();
        if (restarts) this.base = now + 1;
        if (next !== never) this.next = this.cycle_of(this.index_at(now + 1) + left);
    }

    set_shift_control(value, now) {
        if ((value ^ this.shiftctrl) >>> 30) {
            this.tx = [];
            this.rx = [];
        }
        this.shiftctrl = value;
        this.decode();
        this.schedule_refill(now);
    }

    // FIFOs.

    write_tx(value, now) {
        if (this.tx.length >= this.tx_depth) return false;
        this.tx.push(value);
        if (this.stall === stalled_on_tx) this.wake(this.tick_from(now + 1));
        else this.schedule_refill(now);
        return true;
    }

    read_rx(now) {
        const value = this.rx.shift();
        if (this.stall === stalled_on_rx) this.wake(this.tick_from(now + 1));
        return value;
    }

    wake(cycle) {
        if (cycle < this.next) this.next = cycle;
    }

    /// With autopull, an empty OSR is refilled whatever the machine does.
    schedule_refill(now) {
        const wanted = this.autopull && this.osc >= this.pull_at && this.tx.length > 0;
        if (wanted && this.enabled && this.refill_at === never) {
            this.unpark(now);
            this.refill_at = this.tick_from(now + 1);
        }
    }

    refill() {
        this.refill_at = never;
        if (this.osc >= this.pull_at && this.tx.length > 0) this.pull_word();
    }

    pull_word() {
        this.osr = this.tx.shift();
        this.osc = 0;
        this.is_pure = false;
        this.pio.touched = true;
        this.pio.signal_tx(this.index);
    }

    push_word() {
        this.rx.push(this.isr);
        this.isr = 0;
        this.isc = 0;
        this.is_pure = false;
        this.pio.touched = true;
        this.pio.signal_rx(this.index);
    }

    // Execution.

    /// Acts at the tick `cycle`.
    act(cycle) {
        if (this.parked) this.move_to(this.park_limit);
        const from_memory = this.exec === none;
        const opcode = from_memory ? this.pio.program[this.pc] : this.exec;
        if (this.refill_at <= cycle && uses_osr(opcode)) this.refill_at = never;
        this.execute(opcode, cycle, from_memory);
        if (this.refill_at <= cycle) this.refill();
    }

    execute(opcode, cycle, from_memory) {
        this.time = cycle;
        this.jumped = false;
        this.next_exec = none;
        const before = this.pc;
        const done = this.operate(opcode);
        const delay = this.set_side(opcode);
        if (!done) return this.stay(cycle, opcode, from_memory);
        this.stall = flows;
        this.exec = this.next_exec;
        if (from_memory && !this.jumped)
            this.pc = before === this.wrap_top ? this.wrap_bottom : (before + 1) & 31;
        const chains = this.next_exec !== none;
        if (!this.enabled) return;
        this.next = this.tick_after(cycle, chains ? 0 : delay);
        if (chains || !from_memory) this.is_pure = false;
        else if (this.pc <= before || this.jumps_by_data) this.close_loop();
    }

    /// Executes an instruction from outside, at the end of `cycle`; a stalled one waits on, unless
    /// a jump leads away from it.
    force(opcode, cycle) {
        const { next, stall, stall_mask, pushes } = this;
        this.pushes = false;
        this.execute(opcode, cycle, false);
        this.loop_pc = none;
        if (!this.enabled || this.exec !== none || this.stall !== flows) return;
        if (this.jumped) {
            this.irq_waits = false;
            return;
        }
        this.pushes = pushes;
        this.stall = stall;
        this.stall_mask = stall_mask;
        this.next = Math.max(next, this.next);
        if (stall === stalled_on_tx && this.tx.length > 0) this.next = this.tick_after(cycle, 0);
    }

    note_stall_again() {
        if (this.stall === stalled_on_tx) this.pio.note_stall(24, this.index);
        if (this.stall === stalled_on_rx) this.pio.note_stall(0, this.index);
    }

    /// The instruction was not completed: it is tried again at each tick.
    stay(cycle, opcode, from_memory) {
        this.is_pure = false;
        if (!from_memory) this.exec = opcode;
        if (!this.enabled) return;
        const stays = this.pio.parks && this.stall !== flows && this.is_settled(cycle);
        this.next = stays ? never : this.tick_after(cycle, 0);
    }

    /// Somebody else wrote pins: a stalled instruction sets its side pins at each tick.
    side_disturbed(mask, from) {
        const stays = this.enabled && this.stall !== flows;
        if (stays && this.sided & mask) this.wake(this.tick_from(from));
    }

    /// Nothing is under way that would end the stall.
    is_settled(cycle) {
        if (this.stall !== stalled_on_pin) return true;
        return this.pio.pins.is_steady(this.stall_mask, cycle - sync_cycles);
    }

    /// Returns the delay.
    set_side(opcode) {
        const field = (opcode >>> 8) & 31;
        const { side_count } = this;
        this.sided = 0;
        if (side_count === 0) return field;
        const delay = field & ((1 << (5 - side_count)) - 1);
        const value = (field >>> (5 - side_count)) & ((1 << this.side_bits) - 1);
        if (this.side_enable && !(field & 16)) return delay;
        const word = rotate_left(value, this.side_base);
        this.sided = this.side_mask;
        if (this.side_to_dirs) this.pio.write_dirs(this, this.side_mask, word);
        else this.pio.write_pins(this, this.side_mask, word);
        return delay;
    }

    /// Returns whether the instruction is completed.
    operate(opcode) {
        this.jumps_by_data = false;
        switch (opcode >>> 13) {
            case 0:
                if (this.jumps((opcode >>> 5) & 7)) this.jump(opcode & 31);
                return true;
            case 1:
                return this.wait(opcode);
            case 2:
                return this.shift_in(opcode);
            case 3:
                return this.shift_out(opcode);
            case 4:
                return opcode & 0x80 ? this.pull(opcode) : this.push(opcode);
            case 5:
                this.move(opcode);
                return true;
            case 6:
                return this.raise_irq(opcode);
            default:
                this.set(opcode);
                return true;
        }
    }

    jump(address) {
        this.pc = address;
        this.jumped = true;
    }

    jumps(condition) {
        switch (condition) {
            case 0:
                return true;
            case 1:
                this.use_x();
                return this.x === 0;
            case 2: {
                const was = this.x;
                this.x = (was - 1) >>> 0;
                if (this.x_lent) return was !== 0;
                ++this.x_taken;
                if (was === 0) this.x_used = true; // the next round goes another way
                return was !== 0;
            }
            case 3:
                this.y_used = true;
                return this.y === 0;
            case 4: {
                const was = this.y;
                this.y = (was - 1) >>> 0;
                ++this.y_taken;
                if (was === 0) this.y_used = true;
                return was !== 0;
            }
            case 5:
                this.use_x();
                this.y_used = true;
                return this.x !== this.y;
            case 6:
                return this.read_pins(1 << this.jmp_pin) !== 0;
            default:
                return this.osc < this.pull_at;
        }
    }

    /// The inputs of `mask`, in their places.
    read_pins(mask) {
        const { pins, bypass } = this.pio;
        let word = pins.synchronised(this.time);
        if (bypass) word = (word & ~bypass) | (pins.inputs_at(this.time) & bypass);
        word &= mask;
        if ((this.seen_value ^ word) & this.seen_mask & mask) this.is_pure = false;
        this.seen_mask |= mask;
        this.seen_value |= word;
        return word;
    }

    /// The inputs from IN_BASE on.
    read_in_pins(count) {
        const word = this.read_pins(field_mask(this.in_base, count));
        return rotate_left(word, (32 - this.in_base) & 31) >>> 0;
    }

    irq_number(opcode) {
        const number = opcode & 7;
        return opcode & 0x10 ? (number & 4) | ((number + this.index) & 3) : number;
    }

    wait(opcode) {
        const wanted = (opcode >>> 7) & 1;
        const source = (opcode >>> 5) & 3;
        const index = opcode & 31;
        if (source === 2) return this.wait_for_irq(wanted, this.irq_number(opcode));
        if (source === 3) fault('PIO: WAIT on a reserved source');
        const gpio = source === 0 ? index : (index + this.in_base) & 31;
        const mask = 1 << gpio;
        const level = this.read_pins(mask) !== 0 ? 1 : 0;
        if (level === wanted) return true;
        this.stall = stalled_on_pin;
        this.stall_mask = mask;
        return false;
    }

    wait_for_irq(wanted, number) {
        this.is_pure = false;
        if (((this.pio.irq >>> number) & 1) !== wanted) {
            this.stall = stalled_on_irq;
            return false;
        }
        if (wanted) this.pio.clear_irq(1 << number);
        return true;
    }

    source(number, count) {
        switch (number) {
            case 0:
                return this.read_in_pins(count);
            case 1:
                this.use_x();
                return this.x;
            case 2:
                this.y_used = true;
                return this.y;
            case 3:
                return 0;
            case 5:
                return this.status();
            case 6:
                this.lose_count();
                return this.isr;
            case 7:
                return this.osr;
            default:
                return fault(`PIO: reserved source ${number}`);
        }
    }

    status() {
        this.is_pure = false;
        const level = this.status_rx ? this.rx.length : this.tx.length;
        return level < this.status_level ? 0xffffffff : 0;
    }

    shift_in(opcode) {
        const count = opcode & 31 || 32;
        this.lose_count();
        if (!this.pushes) {
            const number = (opcode >>> 5) & 7;
            if (number === 5) fault('PIO: IN from a reserved source');
            const value = this.source(number, count);
            this.isr = this.shifted_in(value, count);
            this.isc = Math.min(32, this.isc + count);
        }
        if (!this.autopush || this.isc < this.push_at) return true;
        if (this.rx.length >= this.rx_depth) return this.stall_on_rx();
        this.pushes = false;
        this.push_word();
        return true;
    }

    stall_on_rx() {
        this.pushes = true;
        this.stall = stalled_on_rx;
        this.pio.note_stall(0, this.index);
        return false;
    }

    shifted_in(value, count) {
        if (count === 32) return value;
        const bits = value & ((1 << count) - 1);
        const shifted = this.in_right
            ? (this.isr >>> count) | (bits << (32 - count))
            : (this.isr << count) | bits;
        return shifted >>> 0;
    }

    shift_out(opcode) {
        if (this.autopull && this.osc >= this.pull_at) {
            if (this.tx.length > 0) {
                this.pull_word();
                this.stall = flows; // goes on at the next tick
            } else this.stall_on_tx();
            return false;
        }
        const count = opcode & 31 || 32;
        const value = this.shifted_out(count);
        this.osc = Math.min(32, this.osc + count);
        this.put((opcode >>> 5) & 7, value, count);
        if (this.autopull && this.osc >= this.pull_at) {
            if (this.tx.length > 0) this.pull_word();
        }
        return true;
    }

    stall_on_tx() {
        this.stall = stalled_on_tx;
        this.pio.note_stall(24, this.index);
    }

    shifted_out(count) {
        const { osr } = this;
        if (count === 32) {
            this.osr = 0;
            return osr;
        }
        if (this.out_right) {
            this.osr = osr >>> count;
            return osr & ((1 << count) - 1);
        }
        this.osr = (osr << count) >>> 0;
        return osr >>> (32 - count);
    }

    put(destination, value, count) {
        switch (destination) {
            case 0:
                return this.pio.write_pins(this, this.out_mask, rotate_left(value, this.out_base));
            case 1:
                this.set_x(value >>> 0);
                return;
            case 2:
                this.y = value >>> 0;
                this.y_used = true;
                return;
            case 3:
                return;
            case 4:
                return this.pio.write_dirs(this, this.out_mask, rotate_left(value, this.out_base));
            case 5:
                this.jumps_by_data = true;
                return this.jump(value & 31);
            case 6:
                this.lose_count();
                this.isr = value >>> 0;
                this.isc = count;
                return;
            default:
                this.next_exec = value & 0xffff;
        }
    }

    push(opcode) {
        this.is_pure = false;
        if (opcode & 0x40 && this.isc < this.push_at) return true;
        if (this.rx.length < this.rx_depth) {
            this.push_word();
            return true;
        }
        this.pio.note_stall(0, this.index);
        if (opcode & 0x20) {
            this.stall = stalled_on_rx;
            return false;
        }
        this.isr = 0;
        this.isc = 0;
        return true;
    }

    pull(opcode) {
        this.is_pure = false;
        if ((opcode & 0x40 || this.autopull) && this.osc < this.pull_at) return true;
        if (this.tx.length > 0) {
            this.pull_word();
            return true;
        }
        if (opcode & 0x20) {
            this.stall_on_tx();
            return false;
        }
        this.osr = this.x;
        this.osc = 0;
        return true;
    }

    move(opcode) {
        if ((opcode & 0xff) === mov_isr_x && this.keep_count()) return;
        if ((opcode & 0xff) === mov_x_isr && this.fetch_count()) return;
        const operation = (opcode >>> 3) & 3;
        let value = this.source(opcode & 7, 32);
        if (operation === 1) value = ~value >>> 0;
        if (operation === 2) value = reversed(value);
        const destination = (opcode >>> 5) & 7;
        if (destination === 3) fault('PIO: MOV to a reserved destination');
        if (destination === 4) this.next_exec = value & 0xffff;
        else if (destination === 6) {
            this.lose_count();
            this.isr = value;
            this.isc = 0;
        } else if (destination === 7) {
            this.osr = value;
            this.osc = 0;
        } else this.put(destination, value, 32);
    }

    raise_irq(opcode) {
        this.is_pure = false;
        const bit = 1 << this.irq_number(opcode);
        if (opcode & 0x40) {
            this.pio.clear_irq(bit);
            return true;
        }
        if (!this.irq_waits) this.pio.set_irq(bit);
        if (!(opcode & 0x20)) return true;
        if (this.irq_waits && !(this.pio.irq & bit)) {
            this.irq_waits = false;
            return true;
        }
        // At first the flag is not up yet; afterwards, only its fall ends the stall.
        this.stall = this.irq_waits ? stalled_on_irq : flows;
        this.irq_waits = true;
        return false;
    }

    set(opcode) {
        const value = opcode & 31;
        switch ((opcode >>> 5) & 7) {
            case 0:
                return this.pio.write_pins(this, this.set_mask, rotate_left(value, this.set_base));
            case 1:
                this.set_x(value);
                return;
            case 2:
                this.y = value;
                this.y_used = true;
                return;
            case 4:
                return this.pio.write_dirs(this, this.set_mask, rotate_left(value, this.set_base));
            default:
                fault('PIO: SET of a reserved destination');
        }
    }

    // Loops. X may leave its count in the ISR and be used for something else meanwhile.

    use_x() {
        if (!this.x_lent) this.x_used = true;
    }

    set_x(value) {
        this.x = value;
        if (this.counts_in_isr) this.x_lent = true;
        else this.x_used = true;
    }

    keep_count() {
        if (this.x_used || this.x_lent) return false;
        this.isr = this.x;
        this.isc = 0;
        this.counts_in_isr = true;
        this.kept_taken = this.x_taken;
        return true;
    }

    fetch_count() {
        if (!this.counts_in_isr) return false;
        this.x = this.isr;
        this.x_lent = false;
        this.x_taken = this.kept_taken;
        return true;
    }

    /// The ISR is used otherwise.
    lose_count() {
        if (this.counts_in_isr) this.is_pure = false;
        this.counts_in_isr = false;
    }

    forget_loop() {
        this.is_pure = true; // nobody but the machine itself sees what it does
        this.x_used = false;
        this.y_used = false;
        this.x_lent = false;
        this.counts_in_isr = false;
        this.kept_taken = 0;
        this.x_taken = 0;
        this.y_taken = 0;
        this.seen_mask = 0;
        this.seen_value = 0;
        this.written = 0;
    }

    /// The machine is back at an address. If all is as it was there before, but for counters that
    /// count down to zero, it goes round until a counter is zero or an input changes.
    close_loop() {
        if (!this.pio.parks) return;
        if (this.pc === this.loop_pc && this.is_pure && this.is_unchanged()) this.park();
        this.loop_pc = this.pc;
        this.loop_cycle = this.next;
        this.loop_x = this.x;
        this.loop_y = this.y;
        this.loop_isr = this.isr;
        this.loop_osr = this.osr;
        this.loop_isc = this.isc;
        this.loop_osc = this.osc;
        if (!this.parked) this.forget_loop();
    }

    is_unchanged() {
        const counts = (used, taken, before, now) =>
            (before - now) >>> 0 === taken && (taken === 0 || !used);
        const isr = this.counts_in_isr ? this.x : this.loop_isr;
        return (
            !this.x_lent &&
            this.isr === isr &&
            this.osr === this.loop_osr &&
            this.isc === this.loop_isc &&
            this.osc === this.loop_osc &&
            this.refill_at === never &&
            counts(this.x_used, this.x_taken, this.loop_x, this.x) &&
            counts(this.y_used, this.y_taken, this.loop_y, this.y) &&
            this.sees_the_same()
        );
    }

    sees_the_same() {
        const { pins } = this.pio;
        const now = pins.inputs & this.seen_mask;
        return (
            now === this.seen_value && pins.is_steady(this.seen_mask, this.loop_cycle - sync_cycles)
        );
    }

    park() {
        const rounds = (value, taken) => (taken === 0 ? never : Math.floor(value / taken));
        const limit = Math.min(rounds(this.x, this.x_taken), rounds(this.y, this.y_taken));
        if (limit < 1) return;
        this.park_index = this.index_at(this.next);
        this.park_ticks = this.park_index - this.index_at(this.loop_cycle);
        this.park_limit = limit;
        this.parked = true;
        this.next =
            limit === never ? never : this.cycle_of(this.park_index + limit * this.park_ticks);
    }

    /// Puts the parked machine where it is after this many rounds.
    move_to(rounds) {
        this.parked = false;
        this.x = (this.x - rounds * this.x_taken) >>> 0;
        this.y = (this.y - rounds * this.y_taken) >>> 0;
        if (this.counts_in_isr) this.isr = this.x;
        this.next = this.cycle_of(this.park_index + rounds * this.park_ticks);
        this.forget_loop();
        this.loop_pc = none;
    }

    /// Ends the parking, with everything done up to and including `cycle`.
    unpark(cycle) {
        if (!this.parked) return;
        const ticks = this.index_at(cycle + 1) - this.park_index;
        const rounds = Math.max(0, Math.floor(ticks / this.park_ticks));
        this.move_to(Math.min(rounds, this.park_limit));
        while (this.next <= cycle) this.catch_up();
    }

    catch_up() {
        this.act(this.next);
        if (this.parked) this.move_to(0);
    }

    /// Inputs change, at the begin of the cycle `time`.
    see(changed, time) {
        const { bypass } = this.pio;
        if (this.parked && changed & this.seen_mask) this.unpark(time - 1);
        if (this.stall !== stalled_on_pin || !(changed & this.stall_mask)) return;
        const delay = bypass & this.stall_mask ? 0 : sync_cycles;
        if (this.enabled) this.wake(this.tick_from(time + delay));
    }

    see_irq(cycle) {
        if (this.stall === stalled_on_irq && this.enabled) this.wake(this.tick_from(cycle + 1));
    }
}

/// OUT, PULL and MOV to OSR, which come before a refill.
function uses_osr(opcode) {
    const kind = opcode >>> 13;
    return kind === 3 || (kind === 4 && (opcode & 0x80) !== 0) || (opcode & 0xe0e0) === 0xa0e0;
}
