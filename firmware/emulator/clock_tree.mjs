// SPDX-License-Identifier: BSD-3-Clause
// Oscillators, PLLs, clock generators and resets: what must be set up, in which order, before the
// chip runs at 125 MHz. Before that, the real chip is slower; here, each cycle takes 8 ns always.
import { fault, hex } from './fault.mjs';
import { PlainRegisters, reset_values } from './registers.mjs';

export const clk_sys_hz = 125_000_000;
const xosc_hz = 12_000_000;
const usb_hz = 48_000_000;

// How long a PLL takes to lock.
const lock_cycles = 2500;

// From the end of a block's reset until it answers. The chip takes a few cycles of the block's
// clock; at 0 a program that does not wait for RESET_DONE would not be seen.
const reset_cycles = 16;

const xosc_enabled = 0xfab;
const startup_times_4 = 1 << 20;
const all_blocks = 0x1ffffff;

export const reset_bit = {
    adc: 0,
    busctrl: 1,
    dma: 2,
    i2c0: 3,
    i2c1: 4,
    io_bank0: 5,
    io_qspi: 6,
    jtag: 7,
    pads_bank0: 8,
    pads_qspi: 9,
    pio0: 10,
    pio1: 11,
    pll_sys: 12,
    pll_usb: 13,
    pwm: 14,
    rtc: 15,
    spi0: 16,
    spi1: 17,
    syscfg: 18,
    sysinfo: 19,
    tbman: 20,
    timer: 21,
    uart0: 22,
    uart1: 23,
    usb: 24,
};

// What the boot ROM leaves out of reset when it starts from flash.
const after_boot = (1 << reset_bit.io_qspi) | (1 << reset_bit.pads_qspi);

export class Resets {
    constructor(clock) {
        this.clock = clock;
        this.held = all_blocks & ~after_boot;
        this.selected = 0;
        this.done_at = new Array(32).fill(0);
        this.blocks = new Map(); // by bit
    }

    /// `block.reset()` is called when the block is put into reset.
    add(bit, block) {
        this.blocks.set(bit, block);
    }

    is_held(bit) {
        return ((this.held >>> bit) & 1) === 1 || this.clock.now < this.done_at[bit];
    }

    read(offset) {
        if (offset === 0) return this.held;
        if (offset === 4) return this.selected;
        if (offset !== 8) return fault(`RESETS has no register ${hex(offset)}`);
        let done = 0;
        for (let bit = 0; bit < 25; ++bit) if (!this.is_held(bit)) done |= 1 << bit;
        return done;
    }

    write(offset, value) {
        if (offset === 4) this.selected = value & all_blocks;
        if (offset !== 0) return;
        value &= all_blocks;
        for (const [bit, block] of this.blocks) if (value & ~this.held & (1 << bit)) block.reset();
        for (let bit = 0; bit < 25; ++bit)
            if (this.held & ~value & (1 << bit)) this.done_at[bit] = this.clock.now + reset_cycles;
        this.held = value;
    }
}

class Xosc {
    constructor(clock) {
        this.clock = clock;
        this.control = 0;
        this.startup = 0;
        this.stable_at = Infinity;
    }

    get is_stable() {
        return this.clock.now >= this.stable_at;
    }

    read(offset) {
        const is_enabled = this.stable_at !== Infinity;
        switch (offset) {
            case 0x00:
                return this.control;
            case 0x04:
                return (this.is_stable ? 2 ** 31 : 0) + (is_enabled ? 0x1000 : 0);
            case 0x0c:
                return this.startup;
            default:
                return fault(`XOSC's register ${hex(offset)} is not modelled`);
        }
    }

    write(offset, value) {
        if (offset === 0x0c) this.startup = value;
        else if (offset === 0x00) this.write_control(value);
        else if (offset === 0x04) return; // clears what never happens
        else fault(`XOSC's register ${hex(offset)} is not modelled`);
    }

    write_control(value) {
        const was_enabled = this.control >>> 12 === xosc_enabled;
        this.control = value;
        const is_enabled = this.control >>> 12 === xosc_enabled;
        if (!is_enabled) this.stable_at = Infinity;
        else if (!was_enabled) this.stable_at = this.clock.now + this.startup_cycles;
    }

    get startup_cycles() {
        const delay = (this.startup & 0x3fff) * (this.startup & startup_times_4 ? 4 : 1);
        return Math.ceil((delay * 256 * clk_sys_hz) / xosc_hz);
    }
}

class Pll {
    constructor(name, clock, xosc) {
        this.name = name;
        this.clock = clock;
        this.xosc = xosc;
        this.reset();
    }

    reset() {
        this.values = { 0x0: 1, 0x4: 0x2d, 0x8: 0, 0xc: 0x77000 };
        this.locked_at = Infinity;
    }

    /// What comes out, in Hz; 0 when nothing does.
    get frequency() {
        const divided = this.values[0x4] & 0x8 ? 0 : 1; // POSTDIVPD
        if (this.clock.now < this.locked_at || !divided) return 0;
        const { 0x0: control, 0x8: feedback, 0xc: dividers } = this.values;
        const post = ((dividers >>> 16) & 7) * ((dividers >>> 12) & 7);
        return ((xosc_hz / (control & 0x3f)) * feedback) / post;
    }

    read(offset) {
        const locked = this.clock.now >= this.locked_at;
        if (offset === 0) return this.values[0] + (locked ? 2 ** 31 : 0);
        return this.values[offset] ?? fault(`${this.name} has no register ${hex(offset)}`);
    }

    write(offset, value) {
        if (!(offset in this.values)) fault(`${this.name} has no register ${hex(offset)}`);
        this.values[offset] = offset === 0 ? value & 0x7fffffff : value;
        if (offset === 0xc) return;
        const is_off = (this.values[0x4] & 0x21) !== 0; // PD, VCOPD
        if (is_off) this.locked_at = Infinity;
        else if (this.locked_at === Infinity || offset === 0x8) this.start();
    }

    start() {
        const vco = (xosc_hz / (this.values[0] & 0x3f)) * this.values[0x8];
        if (!this.xosc.is_stable) fault(`${this.name} starts before its crystal is stable`);
        if (vco < 750e6 || vco > 1600e6)
            fault(`${this.name}: its VCO would run at ${vco / 1e6} MHz, not 750 to 1600`);
        this.locked_at = this.clock.now + lock_cycles;
    }
}

const ref_control = 0x30;
const ref_divider = 0x34;
const ref_selected = 0x38;
const sys_control = 0x3c;
const sys_divider = 0x40;
const sys_selected = 0x44;
const peri_control = 0x48;
const peri_divider = 0x4c;
const usb_control = 0x54;
const usb_divider = 0x58;
const enabled = 1 << 11;

class Clocks {
    constructor(tree) {
        this.tree = tree;
        this.values = reset_values(0x40008000);
    }

    /// The frequency counter, and which clocks run.
    check_modelled(offset) {
        if ((offset >= 0x80 && offset < 0xa0) || offset === 0xb0 || offset === 0xb4)
            fault(`CLOCKS' register ${hex(offset)} is not modelled`);
    }

    read(offset) {
        if (offset === ref_selected) return 1 << (this.values[ref_control] & 3);
        if (offset === sys_selected) return 1 << (this.values[sys_control] & 1);
        if (offset < 0x78 && offset % 12 === 8) return 1;
        this.check_modelled(offset);
        return this.values[offset];
    }

    write(offset, value) {
        this.check_modelled(offset);
        this.values[offset] = value;
        const { xosc } = this.tree;
        if (offset === ref_control && (value & 3) === 2 && !xosc.is_stable)
            fault('clk_ref is switched to the crystal before that is stable');
        const changes_sys = offset === sys_control || offset === sys_divider;
        if (changes_sys && this.values[sys_control] & 1) this.check_sys();
    }

    check_sys() {
        const source = (this.values[sys_control] >>> 5) & 7;
        const hz = source === 0 ? this.tree.pll_sys.frequency : 0;
        const divided = (hz * 256) / this.values[sys_divider];
        if (divided !== clk_sys_hz)
            fault(`clk_sys would run at ${divided} Hz (source ${source}), not ${clk_sys_hz}`);
    }

    /// Whether clk_peri, for SPI and UART, comes from clk_sys, undivided.
    get peri_runs() {
        const value = this.values[peri_control];
        const source = (value >>> 5) & 7;
        const is_whole = this.values[peri_divider] === 0x100;
        return (value & enabled) !== 0 && source <= 1 && is_whole && this.sys_runs;
    }

    get sys_runs() {
        return (this.values[sys_control] & 1) === 1;
    }

    /// Whether clk_ref comes from the crystal, undivided.
    get ref_is_crystal() {
        return (this.values[ref_control] & 3) === 2 && this.values[ref_divider] === 0x100;
    }

    get usb_runs() {
        const value = this.values[usb_control];
        const source = (value >>> 5) & 7;
        const hz = source === 0 ? this.tree.pll_usb.frequency : 0;
        return (value & enabled) !== 0 && (hz * 256) / this.values[usb_divider] === usb_hz;
    }
}

export class ClockTree {
    constructor(clock) {
        this.xosc = new Xosc(clock);
        this.pll_sys = new Pll('PLL_SYS', clock, this.xosc);
        this.pll_usb = new Pll('PLL_USB', clock, this.xosc);
        this.clocks = new Clocks(this);
        this.rosc = new PlainRegisters(0x40060000, {
            given: { 0x18: 0x80001000 }, // it runs
            without: [0x0c, 0x20],
        });
        this.psm = new PlainRegisters(0x40010000, { given: { 0xc: 0x1ffff } }); // all is on
        this.voltage = new PlainRegisters(0x40064000);
        this.sysinfo = new PlainRegisters(0x40000000, {
            given: { 0x0: 0x20002927, 0x4: 0x2, 0x10: 0xe0c912e8 },
        });
        this.syscfg = new PlainRegisters(0x40004000);
        this.busctrl = new PlainRegisters(0x40030000, { given: { 0x4: 1 } });
        this.tbman = new PlainRegisters(0x4006c000);
    }
}
