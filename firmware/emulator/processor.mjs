// SPDX-License-Identifier: BSD-3-Clause
// The processor in the machine: instructions by rp2040js' core, but exceptions, sleep and events,
// and what they cost, by ourselves.
import { RP2040 } from 'rp2040js';

import { ram_begin, ram_size } from './chip.mjs';
import { fault, hex } from './fault.mjs';
import { InstructionSet } from './instruction_set.mjs';

const program_counter = 15;
const link_register = 14;

// From the interrupt to its first instruction, and back, with memory that never makes it wait.
const entry_cycles = 15;
const exit_cycles = 12;
// From the end of one handler to the first instruction of the next: no registers are moved.
const chained_cycles = 7;

const wait_for_event = 0xbf20;
const wait_for_interrupt = 0xbf30;
const send_event = 0xbf40;
const yields = 0xbf10;
const unmask = 0xb662;
const mask = 0xb672;
const sleeps_on_exit = 2;

// What a sleeping processor waits for.
const awake = 0;
const until_interrupt = 1;
const until_event = 2;

export class Processor {
    constructor(bus, interrupts) {
        this.bus = bus;
        this.interrupts = interrupts;
        this.core = new RP2040().core;
        this.registers = this.core.registers;
        this.sleep = awake;
        this.ram_only = false;
        this.after_exit = false; // the instruction just executed left an exception
        this.instruction_set = new InstructionSet(this.core, (opcode) => this.system(opcode));
        this.wire_core();
    }

    get pc() {
        return this.registers[program_counter];
    }

    wire_core() {
        const { core, bus } = this;
        const lost = (component, message) => fault(`${component}: ${message}, ${this.where()}`);
        core.rp2040.logger = { debug() {}, info() {}, warn: lost, error: lost };
        core.rp2040.onBreak = (code) => fault(`breakpoint ${code}, ${this.where()}`);
        core.readUint32 = (address) => bus.read32(address);
        core.readUint16 = (address) => bus.read16(address);
        core.readUint8 = (address) => bus.read8(address);
        core.writeUint32 = (address, value) => bus.write32(address, value);
        core.writeUint16 = (address, value) => bus.write16(address, value);
        core.writeUint8 = (address, value) => bus.write8(address, value);
        const branch = core.BXWritePC;
        core.BXWritePC = (target) => {
            if ((target & 1) === 0) fault(`jump to ${hex(target)}, no Thumb code, ${this.where()}`);
            branch.call(core, target);
        };
        const leave = core.exceptionReturn;
        core.exceptionReturn = (code) => {
            leave.call(core, code);
            this.after_exit = true;
        };
    }

    where() {
        return `at the instruction ${hex(this.at)}`;
    }

    start(stack, address) {
        const { core } = this;
        core.SP = stack;
        this.registers[program_counter] = (address & ~1) >>> 0;
    }

    /// Executes one instruction, or takes an interrupt. Returns the cycles.
    step() {
        const { interrupts } = this;
        if (interrupts.may_interrupt && !this.core.PM) {
            const exception = interrupts.next();
            if (exception !== 0) return this.enter(exception, entry_cycles);
        }
        const address = this.registers[program_counter];
        this.at = address;
        const offset = (address - ram_begin) >>> 0;
        const opcode = offset < ram_size ? this.bus.halves[offset >>> 1] : this.fetch(address);
        if (opcode === undefined) return this.bus.call_rom(address);
        const cycles = this.instruction_set.execute(opcode);
        return this.after_exit ? cycles + this.exit() : cycles;
    }

    fetch(address) {
        if (this.bus.is_rom_function(address)) return undefined;
        if (this.ram_only) fault(`execution outside of RAM at ${hex(address)}`);
        if (address < 0x10000000 || address >= 0x14000000)
            fault(
                `execution where no code is, at ${hex(address)} after ${hex(this.previous ?? 0)}`,
            );
        return this.bus.read16(address);
    }

    enter(exception, cycles) {
        const { core, interrupts } = this;
        this.at = this.pc;
        this.sleep = awake;
        interrupts.begin(exception);
        core.VTOR = interrupts.vectors;
        core.exceptionEntry(exception);
        interrupts.event = true;
        const handler = this.registers[program_counter];
        if ((handler & 1) === 0)
            fault(`the vector of exception ${exception} is ${hex(handler)}: no Thumb code`);
        this.registers[program_counter] = (handler & ~1) >>> 0;
        return cycles;
    }

    exit() {
        const { interrupts, core } = this;
        this.after_exit = false;
        interrupts.end();
        interrupts.event = true;
        const exception = core.PM ? 0 : interrupts.next();
        if (exception !== 0) return this.enter(exception, chained_cycles);
        if (interrupts.active.length === 0 && interrupts.control & sleeps_on_exit)
            this.sleep = until_interrupt;
        return exit_cycles;
    }

    system(opcode) {
        const { core, interrupts } = this;
        this.registers[program_counter] += 2;
        switch (opcode) {
            case mask:
                core.PM = true;
                return 1;
            case unmask:
                core.PM = false;
                return 1;
            case wait_for_interrupt:
                this.sleep = until_interrupt;
                return 2;
            case wait_for_event:
                if (interrupts.event) interrupts.event = false;
                else this.sleep = until_event;
                return 2;
            case send_event:
                interrupts.event = true;
                return 1;
            case yields:
                return 1;
            default:
                return fault(`instruction ${hex(opcode)} is not modelled, ${this.where()}`);
        }
    }

    /// Whether the processor sleeps on.
    stays_asleep() {
        const { interrupts } = this;
        const wanted = interrupts.may_interrupt && interrupts.next() !== 0;
        if (this.sleep === until_interrupt && wanted) this.sleep = awake;
        if (this.sleep === until_event && (interrupts.event || (wanted && !this.core.PM))) {
            interrupts.event = false;
            this.sleep = awake;
        }
        return this.sleep !== awake;
    }

    /// Returns from a function of the boot ROM.
    return_from_rom() {
        this.registers[program_counter] = (this.registers[link_register] & ~1) >>> 0;
    }
}
