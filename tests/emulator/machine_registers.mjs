// SPDX-License-Identifier: BSD-3-Clause
// The machine's registers against what the vendor says of them: values after reset, bits that can
// be written, and what is no register.
import { check, check_fault, finish } from './check.mjs';
import { reset_bit } from './clock_tree.mjs';
import { Fault, hex } from './fault.mjs';
import { Machine } from './machine.mjs';
import { page_size, register_pages } from './registers.mjs';
import { peek, poke } from './setup.mjs';

Error.stackTraceLimit = 0; // of all the faults that are wanted
const ones = 0xffffffff;
const resets_begin = 0x4000c000;

// Exceptions: patterns of BLOCK.REGISTER, each with the reason. One that is not needed is an error.

/// Registers of the chip whose use ends the run: what they do is not modelled.
const not_modelled = {
    'CLOCKS.(FC0_.*|ENABLED.)': 'frequency counter, clocks that run',
    'IO_QSPI.(INTR|.*_INT.)': 'interrupts by the pins of the flash',
    'IO_BANK0.(PROC1|DORMANT_WAKE)_INT.*': 'the second core, sleep without clocks',
    'PPB.(SYST_CALIB|CCR|SHPR2|SHCSR|MPU_(CTRL|R.*))': 'SVC, faults that are distinguished, MPU',
    'SSI.(MWCR|R?ISR|.*ICR)': 'interrupts, Microwire',
    'SSI.DR0': 'nothing is there to be read',
    'XIP_CTRL.STREAM_.*': 'streaming',
    '[XR]OSC.(DORMANT|COUNT)': 'sleep without clocks, counters',
    '(UART|SPI)..(UART|SSP)P(ERIPH|CELL)ID.': 'numbers of the design',
    'WATCHDOG.LOAD': 'can be written only',
    'TIMER.TIME.W': 'can be written only',
    'DMA.(INTR1|TIMER.|SNIFF_.*|FIFO_LEVELS|CH.*_CTDREQ)': 'pacing timers, sniffer, debugging',
    'SIO.(GPIO_HI_O.*|FIFO_[WR].|INTERP.*)': 'pins of the flash, second core, interpolators',
    'USB.(ADDR_ENDP.+|SOF_WR|INT_EP_CTRL)': 'host mode',
};

/// What is read after reset, where that depends on more than the block.
const found_after_reset = {
    'RESETS.RESET': [0, 'this test'],
    'RESETS.RESET_DONE': [0x1ffffff, 'this test'],
    'PSM.DONE': [0x1ffff, 'all is on while a program runs'],
    'ROSC.STATUS': [0x80001000, 'it runs'],
    'BUSCTRL.BUS_PRIORITY_ACK': [1, 'set by the time a program runs'],
    'SYSINFO.CHIP_ID': [0x20002927, 'of the chip'],
    'SYSINFO.PLATFORM': [2, 'of the chip'],
    'IO_BANK0.INTR[012]': [0x11111111, 'each pin is low'],
    'IO_BANK0.INTR3': [0x111111, 'each pin is low'],
    'SSI.CTRLR0': [0x1f0300, 'the boot ROM'],
    'SSI.(SSIENR|SER)': [1, 'the boot ROM'],
    'SSI.SR': [6, 'the FIFO is empty and takes words'],
    'PIO..DBG_CFGINFO': [0x200404, 'of the chip'],
    'PIO..INTR': [0xf0, 'the FIFOs take words'],
    'SIO.GPIO_HI_IN': [0x3e, 'the pins of the flash'],
    'SIO.SPINLOCK.*': [undefined, 'a read takes it'],
};

/// Where what is read after a write does not show the write.
const acts = {
    'CLOCKS.CLK_SYS_CTRL': 'a wrong clock ends the run',
    'PLL_...\.PWR': 'without its crystal it ends the run',
    'WATCHDOG.CTRL': 'it bites',
    'WATCHDOG.TICK': 'a wrong tick ends the run',
    'IO_BANK0.GPIO.*_CTRL': 'a function that is not modelled ends the run',
    'PPB.SYST_CVR': 'any write sets it to zero',
    'PPB.NVIC_IC.R': 'clears',
    'PPB.ICSR': 'NMI ends the run',
    'PPB.AIRCR': 'needs its key',
    'SSI.(CTRLR0|BAUDR)': 'ends the run while it is enabled',
    'UART..UARTDR': 'another FIFO is read',
    'SPI..SSPDR': 'another FIFO is read',
    'SPI..SSPCR0': 'other frames end the run',
    'I2C..IC_CON': 'slave mode ends the run',
    'I2C..IC_DATA_CMD': 'while it is disabled it ends the run',
    'DMA.CH.*(TRANS_COUNT.*)': 'the count of the next transfer is written, that of this is read',
    'DMA.CH.*_CTRL_TRIG': 'the sniffer ends the run',
    'DMA.CH.*_AL._CTRL': 'as CTRL_TRIG, whose bits are distinguished',
    'DMA.MULTI_CHAN_TRIGGER': 'triggers',
    'PIO..CTRL': 'restarts',
    'PIO..(TXF.|IRQ_FORCE|INSTR_MEM.*)': 'can be written only',
    'PIO..SM._EXECCTRL': 'bits that are not modelled end the run',
    'PIO..SM._INSTR': 'executes',
    'SIO.GPIO_O.*_CLR': 'clears',
    'SIO.SPINLOCK.*': 'a read takes it',
    'USB.MAIN_CTRL': 'host mode ends the run',
};

const used = new Set();

/// The entry of `list` for this register. Ask only where one is needed.
function listed(list, name) {
    const found = Object.entries(list).find(([pattern]) => new RegExp(`^(${pattern})$`).test(name));
    if (found !== undefined) used.add(found[0]);
    return found?.[1];
}

function no_idle_exceptions() {
    for (const list of [not_modelled, found_after_reset, acts])
        for (const pattern of Object.keys(list))
            check(`the exception ${pattern} is needed`, used.has(pattern), true);
}

const machines = new Map(); // by page, where a reset of the block makes all new

/// All blocks out of reset; the block of this page newly so.
function fresh_machine(page) {
    const machine = machines.get(page) ?? new Machine();
    const bit = reset_bit[machine.bus.blocks.get(page / page_size).name];
    if (bit !== undefined) {
        machines.set(page, machine);
        poke(machine, resets_begin, 2 ** bit);
    }
    poke(machine, resets_begin, 0);
    machine.clock.settle(machine.now + 100);
    return machine;
}

/// What `action` returns, or the fault's message.
function outcome(action) {
    try {
        return action();
    } catch (error) {
        if (!(error instanceof Fault)) throw error;
        return error.message;
    }
}

/// Whether the register is modelled.
function check_reset(page, name, { address, reset }) {
    const machine = fresh_machine(page);
    const found = outcome(() => peek(machine, address));
    if (typeof found === 'string') {
        check(`${name} may end the run: ${found}`, listed(not_modelled, name) !== undefined, true);
        return false;
    }
    if (reset === undefined || found === reset) return true;
    const [expected] = listed(found_after_reset, name) ?? [reset];
    if (expected !== undefined) check(`${name} after reset`, hex(found), hex(expected));
    return true;
}

function check_write(page, name, { address, writable }, value) {
    const machine = fresh_machine(page);
    const before = peek(machine, address);
    const expected = ((before & ~writable) | (value & writable)) >>> 0;
    const after = outcome(() => {
        poke(machine, address, value);
        return peek(machine, address);
    });
    const shown = typeof after === 'string' ? after : hex(after);
    const holds = after === expected || listed(acts, name) !== undefined;
    check(`${name} after ${hex(value)} is written is ${shown}, not ${hex(expected)}`, holds, true);
}

function registers() {
    for (const [page, { block, registers }] of register_pages)
        for (const register of registers.values()) {
            const name = `${block}.${register.name}`;
            if (!check_reset(page, name, register)) continue;
            check_write(page, name, register, ones);
            check_write(page, name, register, 0);
        }
}

function no_registers() {
    for (const [page, { block, registers }] of register_pages) {
        const machine = fresh_machine(page);
        const { has_aliases } = machine.bus.blocks.get(page / page_size);
        const end = page + (has_aliases ? 0x1000 : page_size);
        for (let address = page; address < end; address += 4) {
            if (registers.has(address)) continue;
            const what = `${block} has nothing at ${hex(address)}`;
            check_fault(`${what}, read`, 'has no register', () => peek(machine, address));
            check_fault(`${what}, written`, 'has no register', () => poke(machine, address, 0));
        }
    }
}

registers();
no_registers();
no_idle_exceptions();
finish('registers of the machine');
