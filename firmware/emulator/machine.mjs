// SPDX-License-Identifier: BSD-3-Clause
// A whole RP2040 on one clock, in cycles of 8 ns, on the instructions of rp2040js: runs the real
// firmware's image, reports what it does with its pins and on USB, and stops with a Fault where the
// chip would misbehave. Every run of the same program with the same inputs is the same.
//
//   const machine = new Machine({ flash });   // bytes of an .elf, a .uf2, or of the flash itself
//   machine.watch([0, 1, 25]);                // GPIO whose changes go to machine.log
//   machine.set_input(2, 1, at_cycle);        // level 0, 1 or undefined (nothing drives it)
//   machine.set_path(2, { rise_ns: 5 });      // what lies before a pin: see pin_path.mjs
//   const why = machine.run_until(cycle);     // 'time', or what stopped it: see below
//   machine.usb.write(bytes, at_cycle);       // see usb_host.mjs
//
// run_until() and run_for() return 'time', 'boot loader' (the program asked for it), 'watchdog'
// (it bit), 'reset' (by AIRCR), 'asked' (stop() was called), or throw a Fault. After the first
// three, `machine.reboot()` returns a new machine with the flash and the watchdog's scratch words.
//
// machine.now: the cycle at which it is. machine.sleep_cycles: those the processor slept.
// machine.log: [{cycle, levels, driven}, ...], words with a bit per GPIO; a pin whose bit in
//     `driven` is 0 is high impedance. The levels hold from the end of that cycle.
// machine.on_output = (entry) => ...: called with each entry of the log.
// machine.levels, machine.driven: the pins now.
// machine.wire(from, to): connects two GPIO outside of the chip.
// machine.stop(): ends run_until() after the present instruction.
// machine.spi[n], .uart[n], .i2c[n]: models are attached there; see spi.mjs and so on.
// machine.flash.bytes, .operations; machine.cut_power(): the flash as it is found after that.
// machine.at(cycle, action): calls `action` when that cycle is over.
//
// Options: ram_only (execution outside of RAM and ROM is a fault), naive (nothing is skipped; the
// results are the same), on_fault(fault) (then a fault ends the run, as 'fault'), usb_times,
// flash_times, reason and scratch (of the watchdog).
//
// Exact to the cycle: PIO, inputs and outputs, timer, SysTick. Frames of SPI, UART, I2C and USB
// have their real lengths. About right: the path of the DMA, exceptions that overtake each other,
// pauses between SPI words. Not modelled: the second core, waits for memory banks that the DMA uses
// at the same time, caching of flash, PWM, ADC, RTC, interpolators, levels within serial frames.
// Registers that are not modelled are faults. An access of the processor happens in the first cycle
// of its instruction.
import { Bus } from './bus.mjs';
import { BootRom } from './boot.mjs';
import { ram_begin } from './chip.mjs';
import { Clock } from './clock.mjs';
import { ClockTree, Resets, reset_bit } from './clock_tree.mjs';
import { Dma } from './dma.mjs';
import { Fault, hex } from './fault.mjs';
import { FlashChip, QspiIo, Ssi, flash_size } from './flash.mjs';
import { I2c, i2c_pins } from './i2c.mjs';
import { Image } from './image.mjs';
import { Interrupts, irq } from './interrupts.mjs';
import { Pins, io_block, pads_block, pin_function } from './pins.mjs';
import { Pio } from './pio.mjs';
import { Processor } from './processor.mjs';
import { PlainRegisters } from './registers.mjs';
import { Sio } from './sio.mjs';
import { Spi, SpiPins } from './spi.mjs';
import { Timer } from './timer.mjs';
import { Uart, UartPins } from './uart.mjs';
import { UsbDevice } from './usb_device.mjs';
import { UsbHost } from './usb_host.mjs';
import { Watchdog } from './watchdog.mjs';
import { is_uf2, read_uf2 } from './uf2.mjs';

const flash_begin = 0x10000000;
const elf_magic = 0x464c457f;

/// The flash's contents from an .elf, a .uf2 or raw bytes.
export function flash_image(given) {
    const contents = new Uint8Array(flash_size).fill(0xff);
    const bytes = Buffer.from(given.buffer, given.byteOffset, given.byteLength);
    let segments = [{ address: flash_begin, bytes }];
    if (is_uf2(bytes)) segments = read_uf2(bytes);
    else if (bytes.readUInt32LE(0) === elf_magic) segments = new Image(bytes).programmed();
    for (const segment of segments) {
        const at = segment.address - flash_begin;
        if (at < 0 || at + segment.bytes.length > flash_size)
            throw new Error(
                `the image has ${segment.bytes.length} bytes at ` +
                    `${hex(segment.address)}, which is not in flash`,
            );
        contents.set(segment.bytes, at);
    }
    return contents;
}

export class Machine {
    constructor(options = {}) {
        this.options = options;
        this.clock = new Clock();
        this.stopped = undefined;
        this.sleep_cycles = 0;
        this.parks = !options.naive;
        this.interrupts = new Interrupts(this.clock);
        this.bus = new Bus(() => this.where());
        this.processor = new Processor(this.bus, this.interrupts);
        this.clock.where = () => this.where();
        this.processor.ram_only = options.ram_only ?? false;
        this.interrupts.on_reset_request = () => this.end('reset');
        this.add_system();
        this.add_pins();
        this.add_serial();
        this.add_dma();
        this.add_flash(options);
        this.add_usb(options);
        this.rom = new BootRom(this.bus, this.processor, (...given) => {
            this.watchdog.restart_into_boot_loader(given);
            this.end('boot loader');
        });
        if (options.flash !== undefined) this.rom.start(this.flash.bytes);
    }

    where() {
        return `${this.processor.where()}, cycle ${this.clock.now}`;
    }

    add_block(name, begin, block) {
        const bit = reset_bit[name];
        if (bit === undefined) return this.bus.add(name, begin, block);
        this.bus.add(name, begin, block, () => this.resets.is_held(bit));
        this.resets.add(bit, block);
    }

    add_system() {
        const { clock, interrupts } = this;
        this.resets = new Resets(clock);
        this.tree = new ClockTree(clock);
        this.watchdog = new Watchdog(clock, this.tree.clocks, this.options);
        this.watchdog.on_bite = () => this.end('watchdog');
        this.timer = new Timer(clock, interrupts, this.watchdog);
        this.watchdog.on_tick = () => this.timer.run_or_stand();
        this.add_block('sysinfo', 0x40000000, this.tree.sysinfo);
        this.add_block('syscfg', 0x40004000, this.tree.syscfg);
        this.add_block('CLOCKS', 0x40008000, this.tree.clocks);
        this.add_block('RESETS', 0x4000c000, this.resets);
        this.add_block('PSM', 0x40010000, this.tree.psm);
        this.add_block('XOSC', 0x40024000, this.tree.xosc);
        this.add_block('pll_sys', 0x40028000, this.tree.pll_sys);
        this.add_block('pll_usb', 0x4002c000, this.tree.pll_usb);
        this.add_block('busctrl', 0x40030000, this.tree.busctrl);
        this.add_block('timer', 0x40054000, this.timer);
        this.add_block('WATCHDOG', 0x40058000, this.watchdog);
        this.add_block('ROSC', 0x40060000, this.tree.rosc);
        this.add_block('VREG_AND_CHIP_RESET', 0x40064000, this.tree.voltage);
        this.add_block('tbman', 0x4006c000, this.tree.tbman);
        this.bus.add(
            'the processor',
            0xe000e000,
            {
                read: (offset) => interrupts.read(offset & 0xfff),
                write: (offset, value) => interrupts.write(offset & 0xfff, value),
            },
            undefined,
            false,
        );
    }

    add_pins() {
        const { clock, interrupts, parks } = this;
        const pins = (this.pins = new Pins(clock, interrupts));
        this.add_block('io_bank0', 0x40014000, io_block(pins));
        this.add_block('pads_bank0', 0x4001c000, pads_block(pins));
        this.sio = new Sio(clock, pins);
        this.bus.add('SIO', 0xd0000000, this.sio, undefined, false);
        this.pio = [0, 1].map((number) => {
            const line = number === 0 ? irq.pio0 : irq.pio1;
            const name = `pio${number}`;
            const dreq = 8 * number;
            return new Pio({ name, clock, pins, interrupts, line, dreq, parks });
        });
        this.add_block('pio0', 0x50200000, this.pio[0]);
        this.add_block('pio1', 0x50300000, this.pio[1]);
        pins.add_source(pin_function.sio, this.sio);
        pins.add_source(pin_function.pio0, this.pio[0]);
        pins.add_source(pin_function.pio1, this.pio[1]);
    }

    add_serial() {
        const { clock, pins, interrupts } = this;
        const { clocks } = this.tree;
        this.spi = [0, 1].map((number) => {
            const name = `spi${number}`;
            return new Spi({ name, number, clock, pins, interrupts, line: irq.spi0 + number, clocks });
        });
        this.uart = [0, 1].map((number) => {
            const name = `uart${number}`;
            const line = irq.uart0 + number;
            return new Uart({ name, number, clock, pins, interrupts, irq: line, clocks });
        });
        this.i2c = [0, 1].map((number) => {
            const name = `i2c${number}`;
            return new I2c({ name, number, clock, pins, interrupts, line: irq.i2c0 + number });
        });
        this.add_block('i2c0', 0x40044000, this.i2c[0]);
        this.add_block('i2c1', 0x40048000, this.i2c[1]);
        pins.add_source(pin_function.i2c, i2c_pins);
        this.add_block('spi0', 0x4003c000, this.spi[0]);
        this.add_block('spi1', 0x40040000, this.spi[1]);
        this.add_block('uart0', 0x40034000, this.uart[0]);
        this.add_block('uart1', 0x40038000, this.uart[1]);
        pins.add_source(pin_function.spi, new SpiPins(this.spi));
        pins.add_source(pin_function.uart, new UartPins(this.uart));
    }

    add_dma() {
        const requests = [];
        this.dma = new Dma(this.clock, this.bus, this.interrupts, requests);
        this.pio.forEach((pio, block) => {
            pio.dma = this.dma;
            for (let i = 0; i < 8; ++i) requests[8 * block + i] = () => pio.requests(i);
        });
        const pairs = [
            ...this.spi.map((spi, i) => [spi, 16 + 2 * i]),
            ...this.uart.map((uart, i) => [uart, 20 + 2 * i]),
            ...this.i2c.map((i2c, i) => [i2c, 32 + 2 * i]),
        ];
        for (const [block, first] of pairs) {
            requests[first] = () => block.wants_tx();
            requests[first + 1] = () => block.wants_rx();
            block.signal = (is_receive) => this.dma.signal(first + (is_receive ? 1 : 0));
        }
        this.add_block('dma', 0x50000000, this.dma);
    }

    add_flash({ flash, flash_times }) {
        const contents =
            flash === undefined ? new Uint8Array(flash_size).fill(0xff) : flash_image(flash);
        this.flash = new FlashChip(this.clock, contents, { times: flash_times });
        this.ssi = new Ssi(this.clock, this.flash);
        this.bus.flash = this.ssi;
        this.bus.add('XIP_SSI', 0x18000000, this.ssi, undefined, false);
        const cache = new PlainRegisters(0x14000000, { without: [0x14, 0x18, 0x1c] }); // streams
        this.bus.add('XIP_CTRL', 0x14000000, cache);
        this.add_block('io_qspi', 0x40018000, new QspiIo(this.ssi));
        this.add_block('pads_qspi', 0x40020000, new PlainRegisters(0x40020000));
    }

    add_usb({ usb_times }) {
        const { clock, interrupts } = this;
        this.usb_device = new UsbDevice(clock, interrupts, this.tree.clocks);
        this.add_block('usb', 0x50110000, this.usb_device);
        this.usb = new UsbHost(clock, this.usb_device, { parks: this.parks, times: usb_times });
    }

    // What a test does with it.

    get now() {
        return this.clock.now;
    }
    get log() {
        return this.pins.log;
    }
    get levels() {
        return this.pins.pad >>> 0;
    }
    get driven() {
        return this.pins.driven >>> 0;
    }
    set on_output(listener) {
        this.pins.on_output = listener;
    }

    watch(gpios) {
        for (const gpio of gpios) this.pins.watched |= 1 << gpio;
    }

    set_input(gpio, level, at = this.now) {
        const { clock, pins } = this;
        const from = Math.max(at, clock.now);
        clock.input_at(Math.floor(from), () => pins.set_external(gpio, level, from));
    }

    set_path(gpio, properties) {
        return this.pins.set_path(gpio, properties);
    }

    at(cycle, action) {
        this.clock.at(Math.max(cycle, this.now), action);
    }

    /// Connects two GPIO: what one drives, the other sees from the next cycle on.
    wire(from, to) {
        let last;
        this.pins.pad_listeners.push(() => {
            const level =
                (this.pins.driven >>> from) & 1 ? (this.pins.pad >>> from) & 1 : undefined;
            if (level === last) return;
            last = level;
            this.set_input(to, level, this.now + 1);
        });
    }

    /// Puts bytes into RAM and starts there: word 0 is the stack, word 1 the first instruction.
    start_in_ram(bytes, address = ram_begin) {
        this.bus.ram.set(bytes, address - ram_begin);
        this.interrupts.vectors = address;
        this.processor.start(this.bus.read32(address), this.bus.read32(address + 4));
    }

    end(why) {
        this.stopped ??= why;
    }
    stop() {
        this.end('asked');
    }

    /// A new machine with the same flash, as after the reset that stopped this one.
    reboot(options = {}) {
        const { reason, scratch } = this.watchdog;
        return new Machine({
            ...this.options,
            flash: this.flash.bytes,
            reason,
            scratch,
            ...options,
        });
    }

    /// The flash as it is found when the power fails now.
    cut_power() {
        return this.flash.cut_power();
    }

    run_for(cycles) {
        return this.run_until(this.now + cycles);
    }

    run_until(end) {
        try {
            this.live(end);
        } catch (error) {
            if (!(error instanceof Fault) || this.options.on_fault === undefined) throw error;
            this.options.on_fault(error);
            this.end('fault');
        }
        const why = this.stopped ?? 'time';
        if (why === 'asked') this.stopped = undefined;
        return why;
    }

    live(end) {
        const { clock, processor } = this;
        clock.settle(clock.now);
        while (clock.now < end && this.stopped === undefined) {
            if (processor.sleep !== 0 && processor.stays_asleep()) {
                this.skip_sleep(end);
                continue;
            }
            const next = clock.now + processor.step();
            if (next >= clock.due) clock.settle(next);
            else clock.now = next;
        }
    }

    /// Sleeps to the next event, which may wake the processor.
    skip_sleep(end) {
        const { clock } = this;
        const next = this.parks ? Math.min(Math.max(clock.due, clock.now + 1), end) : clock.now + 1;
        this.sleep_cycles += next - clock.now;
        clock.settle(next);
    }
}
