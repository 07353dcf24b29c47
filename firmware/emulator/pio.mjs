// SPDX-License-Identifier: BSD-3-Clause
// A PIO block: four state machines, their registers, flags and interrupts.
//
// pio.on_start = (cycle) => ...: called when machines are started.
import { fault, hex } from './fault.mjs';
import { StateMachine } from './pio_machine.mjs';

const machine_count = 4;
const machine_registers = 0x0c8;
const machine_stride = 0x18;
const program_begin = 0x048;
const program_size = 32;

export class Pio {
    /// `line` is its first interrupt, `dreq` its first request to the DMA.
    constructor({ name, clock, pins, interrupts, line, dreq, parks }) {
        Object.assign(this, { name, clock, pins, interrupts, line, first_dreq: dreq, parks });
        this.dma = undefined;
        this.machines = Array.from({ length: machine_count }, (_, i) => new StateMachine(this, i));
        pins.listeners.push((changed, time) => this.see(changed, time));
        clock.pios.push(this);
        this.reset();
    }

    reset() {
        this.program = new Uint16Array(program_size);
        this.irq = 0;
        this.irq_raised = 0;
        this.irq_cleared = 0;
        this.debug = 0;
        this.bypass = 0;
        this.out = 0;
        this.enable = 0;
        this.enables = [0, 0]; // of the interrupts
        this.forces = [0, 0];
        this.due = Infinity;
        this.drives = false;
        this.touched = false;
        for (const machine of this.machines) machine.reset();
        this.update_lines();
        this.pins.drive();
    }

    // The state machines' side.

    write_pins(machine, mask, word) {
        const out = (this.out & ~mask) | (word & mask);
        machine.written |= mask;
        if (out === this.out) return;
        this.disturb(machine, mask);
        this.out = out;
        this.drives = true;
    }

    write_dirs(machine, mask, word) {
        const enable = (this.enable & ~mask) | (word & mask);
        machine.written |= mask;
        if (enable === this.enable) return;
        this.disturb(machine, mask);
        this.enable = enable;
        this.drives = true;
    }

    /// A machine that writes these pins in a loop no longer has them to itself.
    disturb(writer, mask) {
        writer.is_pure = false;
        for (const machine of this.machines) {
            const acted = machine.index < writer.index; // in this cycle
            if (machine.written & mask) {
                machine.unpark(acted ? writer.time : writer.time - 1);
                machine.is_pure = false;
            }
            machine.side_disturbed(mask, acted ? writer.time + 1 : writer.time);
        }
    }

    set_irq(bits) {
        this.irq_raised |= bits;
    }
    clear_irq(bits) {
        this.irq_cleared |= bits;
    }

    note_stall(first_bit, index) {
        this.debug |= 1 << (first_bit + index);
    }

    signal_tx(index) {
        this.dma?.signal(this.first_dreq + index);
    }
    signal_rx(index) {
        this.dma?.signal(this.first_dreq + machine_count + index);
    }

    /// Whether the DMA may go on: room in a TX FIFO, or words in an RX FIFO.
    requests(number) {
        const machine = this.machines[number & 3];
        return number < machine_count
            ? machine.tx.length < machine.tx_depth
            : machine.rx.length > 0;
    }

    /// Everything that happens in `cycle`. Flags change at its end.
    run(cycle) {
        for (const machine of this.machines) {
            if (machine.next <= cycle) machine.act(cycle);
            else if (machine.refill_at <= cycle) machine.refill();
        }
        if (this.irq_raised | this.irq_cleared) this.change_irq(cycle);
        this.finish();
    }

    change_irq(cycle) {
        this.irq = (this.irq & ~this.irq_cleared) | this.irq_raised;
        this.irq_raised = 0;
        this.irq_cleared = 0;
        this.touched = true;
        for (const machine of this.machines) machine.see_irq(cycle);
    }

    finish() {
        if (this.drives) {
            this.drives = false;
            this.pins.drive();
        }
        if (this.touched) {
            this.touched = false;
            this.update_lines();
        }
        this.schedule();
    }

    schedule() {
        let due = Infinity;
        for (const machine of this.machines) due = Math.min(due, machine.next, machine.refill_at);
        this.due = due;
        if (due < this.clock.due) this.clock.due = due;
    }

    see(changed, time) {
        for (const machine of this.machines) machine.see(changed, time);
        this.schedule();
    }

    // The processor's side, at the end of the present cycle.

    raw_interrupts() {
        let raw = this.irq << 8;
        for (const { index, rx, tx, tx_depth } of this.machines) {
            if (rx.length > 0) raw |= 1 << index;
            if (tx.length < tx_depth) raw |= 0x10 << index;
        }
        return raw & 0xfff;
    }

    update_lines() {
        if ((this.enables[0] | this.enables[1] | this.forces[0] | this.forces[1]) === 0) {
            if (this.asserts) this.set_lines(0);
            return;
        }
        this.set_lines(this.raw_interrupts());
    }

    set_lines(raw) {
        this.asserts = false;
        for (let i = 0; i < 2; ++i) {
            const level = ((raw & this.enables[i]) | this.forces[i]) !== 0;
            this.asserts ||= level;
            this.interrupts.set_line(this.line + i, level);
        }
    }

    fifo_status() {
        let status = 0;
        for (const { index, tx, rx, tx_depth, rx_depth } of this.machines) {
            if (rx.length >= rx_depth) status |= 1 << index;
            if (rx.length === 0) status |= 0x100 << index;
            if (tx.length >= tx_depth) status |= 0x10000 << index;
            if (tx.length === 0) status |= 0x1000000 << index;
        }
        return status;
    }

    fifo_levels() {
        return this.machines.reduce(
            (word, { index, tx, rx }) =>
                word | (tx.length << (8 * index)) | (rx.length << (8 * index + 4)),
            0,
        );
    }

    read(offset) {
        if (offset >= machine_registers && offset < 0x128) return this.read_machine(offset);
        if (offset >= 0x20 && offset < 0x30) return this.read_fifo((offset - 0x20) >>> 2);
        if (offset >= 0x12c && offset < 0x144) return this.read_interrupt(offset - 0x12c);
        switch (offset) {
            case 0x00:
                return this.machines.reduce((w, { enabled }, i) => w | ((enabled ? 1 : 0) << i), 0);
            case 0x04:
                return this.fifo_status();
            case 0x08:
                return this.debug;
            case 0x0c:
                return this.fifo_levels();
            case 0x30:
                return this.irq;
            case 0x38:
                return this.bypass;
            case 0x3c:
                return this.out;
            case 0x40:
                return this.enable;
            case 0x44:
                return (32 << 16) | (4 << 8) | 4;
            case 0x128:
                return this.raw_interrupts();
            default:
                if (offset < 0xc8) return 0; // write-only
                return fault(`${this.name} has no register ${hex(offset)}`);
        }
    }

    read_fifo(index) {
        const machine = this.machines[index];
        if (machine.rx.length === 0) {
            this.debug |= 0x100 << index;
            return 0;
        }
        const value = machine.read_rx(this.clock.now);
        this.touched = true;
        this.finish();
        return value;
    }

    read_interrupt(offset) {
        const which = offset >= 0xc ? 1 : 0;
        const register = offset % 0xc;
        if (register === 0) return this.enables[which];
        if (register === 4) return this.forces[which];
        return (this.raw_interrupts() & this.enables[which]) | this.forces[which];
    }

    read_machine(offset) {
        const machine = this.machines[Math.floor((offset - machine_registers) / machine_stride)];
        switch ((offset - machine_registers) % machine_stride) {
            case 0x00:
                return machine.clkdiv;
            case 0x04:
                return (machine.execctrl & 0x7fffffff) + (machine.exec >= 0 ? 2 ** 31 : 0);
            case 0x08:
                return machine.shiftctrl;
            case 0x0c:
                machine.unpark(this.clock.now);
                this.schedule();
                return machine.pc;
            case 0x10:
                machine.unpark(this.clock.now);
                this.schedule();
                return machine.exec >= 0 ? machine.exec : this.program[machine.pc];
            default:
                return machine.pinctrl;
        }
    }

    write(offset, value, raw) {
        this.unpark();
        this.write_register(offset, value, raw);
        this.touched = true;
        this.finish();
    }

    unpark() {
        for (const machine of this.machines) machine.unpark(this.clock.now);
    }

    write_register(offset, value, raw) {
        if (offset >= machine_registers && offset < 0x128) return this.write_machine(offset, value);
        if (offset >= 0x10 && offset < 0x20) return this.write_fifo((offset - 0x10) >>> 2, value);
        if (offset >= program_begin && offset < machine_registers) {
            this.program[(offset - program_begin) >>> 2] = value;
            return;
        }
        switch (offset) {
            case 0x00:
                return this.write_control(value);
            case 0x08:
                this.debug &= ~raw;
                return this.note_stalls();
            case 0x30:
                this.irq_cleared |= raw & 0xff;
                return this.change_irq(this.clock.now);
            case 0x34:
                this.irq_raised |= raw & 0xff;
                return this.change_irq(this.clock.now);
            case 0x38:
                this.bypass = value >>> 0;
                return;
            case 0x12c:
            case 0x138:
                this.enables[offset === 0x12c ? 0 : 1] = value & 0xfff;
                return;
            case 0x130:
            case 0x13c:
                this.forces[offset === 0x130 ? 0 : 1] = value & 0xfff;
                return;
            default:
                fault(`${this.name}: the register ${hex(offset)} cannot be written`);
        }
    }

    /// Machines that are still stalled raise their flags again.
    note_stalls() {
        for (const machine of this.machines)
            if (machine.enabled && machine.next === Infinity) machine.note_stall_again();
    }

    write_fifo(index, value) {
        const taken = this.machines[index].write_tx(value, this.clock.now);
        if (!taken) this.debug |= 0x10000 << index;
    }

    write_control(value) {
        const { now } = this.clock;
        for (const machine of this.machines) {
            const bit = 1 << machine.index;
            if (value & (bit << 4)) {
                machine.restart();
                if (machine.enabled) machine.next = machine.tick_from(now + 1);
            }
            if (value & (bit << 8)) machine.set_divider(machine.clkdiv, true, now);
            machine.set_enabled((value & bit) !== 0, now);
        }
        if (value & 15) this.on_start?.(now);
    }

    write_machine(offset, value) {
        const { now } = this.clock;
        const machine = this.machines[Math.floor((offset - machine_registers) / machine_stride)];
        switch ((offset - machine_registers) % machine_stride) {
            case 0x00:
                return machine.set_divider(value, false, now);
            case 0x04:
                machine.execctrl = value & 0x7fffffff;
                return machine.decode();
            case 0x08:
                return machine.set_shift_control(value, now);
            case 0x10:
                return this.force(machine, value & 0xffff);
            case 0x14:
                machine.pinctrl = value;
                return machine.decode();
        }
    }

    /// Executes an instruction from outside, in place of the one that would be next.
    force(machine, opcode) {
        machine.force(opcode, this.clock.now);
        if (this.irq_raised | this.irq_cleared) this.change_irq(this.clock.now);
    }
}
