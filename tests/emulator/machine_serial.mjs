// SPDX-License-Identifier: BSD-3-Clause
// DMA, SPI, UART, I2C and flash of the machine: what they move, when, and what they refuse.
import { check, check_fault, check_within, finish } from './check.mjs';
import { reset_bit } from './clock_tree.mjs';
import { Machine } from './machine.mjs';
import { assemble, pio as code } from './program.mjs';
import { pin_function } from './pins.mjs';
import { give_pins, peek, poke, release, sio_output, start_clocks } from './setup.mjs';

const ram = 0x20010000;
const spi0 = 0x4003c000;
const uart0 = 0x40034000;
const dma = 0x50000000;
const pio0 = 0x50200000;
const ssi = 0x18000000;
const select_control = 0x4001800c;

function machine(...blocks) {
    const made = new Machine();
    start_clocks(made);
    release(made, 'io_bank0', 'pads_bank0', ...blocks);
    made.start_in_ram(assemble('start: cpsid i\nwfi\nb .'));
    made.run_for(20);
    return made;
}

/// DMA channel: `bits` are those of CTRL besides EN and the chain, which goes nowhere.
function start_channel(made, index, { read, write, count, bits, request, chain = index }) {
    const at = dma + 0x40 * index;
    poke(made, at, read);
    poke(made, at + 4, write);
    poke(made, at + 8, count);
    poke(made, at + 0xc, 1 | bits | (request << 15) | (chain << 11));
}

const word_size = 2 << 2;
const incr_read = 1 << 4;
const incr_write = 1 << 5;

function copies() {
    const made = machine('dma');
    for (let i = 0; i < 16; ++i) poke(made, ram + 4 * i, 0x01020304 * (i + 1));
    const copy = { read: ram, write: ram + 0x100, count: 16, request: 63 };
    start_channel(made, 0, { ...copy, bits: word_size | incr_read | incr_write });
    check('it is busy', (peek(made, dma + 0xc) >>> 24) & 1, 1);
    made.run_for(100);
    const words = (at, count) => Array.from({ length: count }, (_, i) => peek(made, at + 4 * i));
    check('a copy', words(ram + 0x100, 16), words(ram, 16));
    check('it is over', (peek(made, dma + 0xc) >>> 24) & 1, 0);
    check('the interrupt', peek(made, dma + 0x400), 1);
    const ring = word_size | incr_read | incr_write | (4 << 6) | (1 << 10); // writes: 16 bytes
    start_channel(made, 1, { ...copy, write: ram + 0x200, count: 6, bits: ring });
    made.run_for(100);
    const wrapped = [4, 5, 2, 3].map((i) => peek(made, ram + 4 * i));
    check('a ring', words(ram + 0x200, 4), wrapped);
    check('behind the ring', peek(made, ram + 0x210), 0xa5a5a5a5);
    const swapped = word_size | (1 << 22) | (1 << 21); // quiet
    start_channel(made, 3, { ...copy, write: ram + 0x300, count: 1, bits: swapped });
    made.run_for(100);
    check('bytes swapped', peek(made, ram + 0x300), 0x04030201);
    check('quietly', peek(made, dma + 0x400), 3);
    poke(made, dma + 0x40c, 3);
    check('acknowledged', peek(made, dma + 0x400), 0);
}

function chains() {
    const made = machine('dma');
    poke(made, ram, 0x1234);
    const at = dma + 0x40 * 5;
    poke(made, at, ram);
    poke(made, at + 4, ram + 8);
    poke(made, at + 8, 1);
    poke(made, at + 0x10, 1 | word_size | (63 << 15) | (5 << 11)); // does not trigger
    made.run_for(50);
    check('not yet', peek(made, ram + 8), 0xa5a5a5a5);
    start_channel(made, 4, {
        read: ram,
        write: ram + 4,
        count: 1,
        bits: word_size,
        request: 63,
        chain: 5,
    });
    made.run_for(50);
    check('chained', [peek(made, ram + 4), peek(made, ram + 8)], [0x1234, 0x1234]);
}

function pio_to_ring() {
    const made = machine('dma', 'pio0');
    // Stamps a word each 10 cycles.
    const program = [code.jmp('x--', 1), code.mov('isr', 'x', 1), code.push({ block: true }, 7)];
    program.forEach((opcode, i) => poke(made, pio0 + 0x48 + 4 * i, opcode));
    poke(made, pio0 + 0xcc, 2 << 12);
    start_channel(made, 2, {
        read: pio0 + 0x20,
        write: ram,
        count: 100,
        bits: word_size | incr_write,
        request: 4,
    });
    poke(made, pio0, 1);
    const { now } = made;
    made.run_for(1000);
    check_within('words', 100 - peek(made, dma + 0x88), 98, 100);
    check(
        'in order',
        [0, 1, 50].map((i) => peek(made, ram + 4 * i)),
        [0, 1, 50].map((i) => i),
    );
    check('no stall', peek(made, pio0 + 8) & 0xf, 0);
    check('time passed', made.now - now, 1000);
}

/// An SPI device that answers with what it got before, and notes its frames.
function echo() {
    const device = { frames: [], selects: [], last: 0x5a };
    device.exchange = (word, frame) => {
        device.frames.push({ ...frame, word });
        const answer = device.last;
        device.last = word;
        return answer;
    };
    device.select = (is_selected, cycle) => device.selects.push([is_selected, cycle]);
    return device;
}

function spi_machine(control, divider, pins = [2, 3, 4]) {
    const made = machine('spi0', 'dma');
    give_pins(made, pin_function.spi, ...pins);
    sio_output(made, 5);
    poke(made, 0xd0000014, 1 << 5);
    const device = echo();
    made.spi[0].attach({ gpio: 5, device });
    poke(made, spi0, control);
    poke(made, spi0 + 0x10, divider);
    poke(made, spi0 + 4, 2);
    return { made, device };
}

function spi_words() {
    const { made, device } = spi_machine(0xf | 0x80, 126); // 16 bits, CPHA
    poke(made, 0xd0000018, 1 << 5);
    const { now } = made;
    for (const word of [0x1111, 0x2222, 0x3333]) poke(made, spi0 + 8, word);
    check('it is busy', (peek(made, spi0 + 0xc) >>> 4) & 1, 1);
    made.run_for(3 * 16 * 126);
    check('no longer', (peek(made, spi0 + 0xc) >>> 4) & 1, 0);
    check(
        'frames',
        device.frames.map(({ begin, end, word }) => [begin - now, end - now, word]),
        [
            [0, 2016, 0x1111],
            [2016, 4032, 0x2222],
            [4032, 6048, 0x3333],
        ],
    );
    check(
        'answers',
        [0, 1, 2].map(() => peek(made, spi0 + 8)),
        [0x5a, 0x1111, 0x2222],
    );
    poke(made, 0xd0000014, 1 << 5);
    check(
        'selects',
        device.selects.map(([is_selected]) => is_selected),
        [true, false],
    );
    poke(made, spi0 + 8, 0x4444);
    made.run_for(3000);
    check('nobody is selected', peek(made, spi0 + 8), 0);
    check('nobody got it', device.frames.length, 3);
}

function spi_pauses_and_faults() {
    const { made, device } = spi_machine(0x7, 10); // 8 bits, CPHA 0
    poke(made, 0xd0000018, 1 << 5);
    poke(made, spi0 + 8, 1);
    poke(made, spi0 + 8, 2);
    made.run_for(1000);
    const [first, second] = device.frames;
    check('a pause between words', second.begin - first.end, 15);
    poke(made, spi0 + 8, 3);
    check_fault('deselected within a frame', 'changes within a frame', () =>
        poke(made, 0xd0000014, 1 << 5),
    );
    const odd = spi_machine(0x7, 9).made;
    check_fault('an odd prescaler', 'is not even', () => poke(odd, spi0 + 8, 1));
    const full = spi_machine(0x7, 254).made;
    for (let i = 0; i < 9; ++i) poke(full, spi0 + 8, i);
    check_fault('a full FIFO', 'full FIFO', () => poke(full, spi0 + 8, 9));
    const overrun = spi_machine(0x7, 2).made;
    for (let i = 0; i < 9; ++i) {
        poke(overrun, spi0 + 8, i);
        overrun.run_for(100);
    }
    check('an overrun', peek(overrun, spi0 + 0x18) & 1, 1);
}

/// A transfer of a word whose pins are these.
function spi_with_pins(...pins) {
    const { made, device } = spi_machine(0x7 | 0x80, 2, pins);
    poke(made, 0xd0000018, 1 << 5);
    poke(made, spi0 + 8, 0x33);
    made.run_for(100);
    return [device.frames[0].word, peek(made, spi0 + 8)];
}

function spi_pins() {
    check('with all pins', spi_with_pins(2, 3, 4), [0x33, 0x5a]);
    check('with the pins of another place', spi_with_pins(18, 19, 20), [0x33, 0x5a]);
    check('without its output', spi_with_pins(2, 4), [0, 0x5a]);
    check('without its input', spi_with_pins(2, 3), [0x33, 0]);
    check('with the input of spi1', spi_with_pins(2, 3, 12), [0x33, 0]);
    check_fault('without its clock', 'no pin has its clock', () => spi_with_pins(3, 4));
    const { made } = spi_machine(0x7 | 0x80, 2);
    poke(made, 0x4001c004 + 4 * 4, 0x16); // input off
    poke(made, 0xd0000018, 1 << 5);
    poke(made, spi0 + 8, 0x33);
    made.run_for(100);
    check('with its input disabled at the pad', peek(made, spi0 + 8), 0);
}

function spi_by_dma() {
    const { made, device } = spi_machine(0xf | 0x80, 126);
    for (let i = 0; i < 12; ++i) made.bus.write16(ram + 2 * i, 100 + i);
    poke(made, spi0 + 0x24, 3);
    poke(made, 0xd0000018, 1 << 5);
    const half = 1 << 2;
    start_channel(made, 0, {
        read: spi0 + 8,
        write: ram + 0x100,
        count: 12,
        bits: half | incr_write,
        request: 17,
    });
    start_channel(made, 1, {
        read: ram,
        write: spi0 + 8,
        count: 12,
        bits: half | incr_read,
        request: 16,
    });
    made.run_for(12 * 2016 + 100);
    check(
        'frames by DMA',
        device.frames.map(({ word }) => word),
        Array.from({ length: 12 }, (_, i) => 100 + i),
    );
    check('without pauses', device.frames[11].end - device.frames[0].begin, 12 * 2016);
    check(
        'answers by DMA',
        [1, 11].map((i) => made.bus.read16(ram + 0x100 + 2 * i)),
        [100, 110],
    );
    check('both ended', peek(made, dma + 0x400), 3);
}

function spi_as_slave() {
    const { made } = spi_machine(0xf | 0x80, 2);
    poke(made, spi0 + 4, 6);
    poke(made, spi0 + 8, 0xabcd);
    check('a slave sends', made.spi[0].exchange_as_master(0x7777), 0xabcd);
    check('and receives', peek(made, spi0 + 8), 0x7777);
    check('without words it sends zero', made.spi[0].exchange_as_master(0), 0);
}

function uart() {
    const made = machine('uart0');
    give_pins(made, pin_function.uart, 0, 1);
    poke(made, uart0 + 0x24, 67); // 115200
    poke(made, uart0 + 0x28, 52);
    poke(made, uart0 + 0x2c, 0x70);
    poke(made, uart0 + 0x30, 0x301);
    const sent = [];
    made.uart[0].on_byte = (byte, cycle) => sent.push([byte, cycle]);
    const levels = [];
    made.watch([0]);
    made.on_output = ({ cycle, levels: word }) => levels.push([word & 1, cycle]);
    const { now } = made;
    for (const byte of [65, 66, 67]) poke(made, uart0, byte);
    check('it is busy', (peek(made, uart0 + 0x18) >>> 3) & 1, 1);
    const character = Math.round(10 * 16 * (67 + 52 / 64)); // 86.8 us
    made.run_for(4 * character);
    check(
        'sent',
        sent,
        [65, 66, 67].map((byte, i) => [byte, now + (i + 1) * character]),
    );
    // Of 'A', 0x41: start, 1 0 0 0 0 0 1 0 from the lowest bit on, stop.
    const at = (bits) => now + Math.round((bits * character) / 10);
    check('its bits', levels.slice(0, 6), [
        [0, now],
        [1, at(1)],
        [0, at(2)],
        [1, at(7)],
        [0, at(8)],
        [1, at(9)],
    ]);
    const begin = made.now + 100;
    made.uart[0].send([1, 2, 3, 4, 5], begin, 115200);
    poke(made, uart0 + 0x38, 0x50);
    made.run_until(begin + 4 * character - 10);
    check('no interrupt yet', peek(made, uart0 + 0x40), 0);
    made.run_until(begin + 4 * character + 10);
    check('half the level', peek(made, uart0 + 0x3c) & 0x10, 0);
    made.run_until(begin + 5 * character + 33 * (character / 10));
    check('the timeout', peek(made, uart0 + 0x40), 0x40);
    check(
        'received',
        [1, 2, 3, 4, 5].map(() => peek(made, uart0)),
        [1, 2, 3, 4, 5],
    );
    made.uart[0].send([7], made.now, 57600);
    made.run_for(4 * character);
    check('another speed', peek(made, uart0) & 0x100, 0x100);
    give_pins(made, 31, 0, 1);
    poke(made, uart0, 68);
    made.uart[0].send([8]);
    made.run_for(4 * character);
    check('without its output', sent.length, 3);
    check('without its input', (peek(made, uart0 + 0x18) >>> 4) & 1, 1);
}

function flash_command(made, bytes, reads = 0) {
    poke(made, select_control, 2 << 8);
    const answer = [...bytes, ...new Array(reads).fill(0)].map((byte) => {
        poke(made, ssi + 0x60, byte);
        made.run_for(200);
        return peek(made, ssi + 0x60);
    });
    poke(made, select_control, 3 << 8);
    return answer.slice(bytes.length);
}

function flash_machine() {
    const made = machine();
    poke(made, ssi + 8, 0);
    poke(made, ssi, 7 << 16);
    poke(made, ssi + 0x14, 6);
    poke(made, ssi + 8, 1);
    return made;
}

const i2c0 = 0x40044000;

/// A device with registers: the first byte written is the number of the next.
function register_device() {
    const device = { registers: new Uint8Array(256).map((_, i) => i ^ 0x55), log: [] };
    device.start = (is_read, cycle) => {
        device.log.push([is_read ? 'read' : 'write', cycle]);
        device.is_first = !is_read;
        return true;
    };
    device.write = (byte) => {
        if (device.is_first) device.number = byte;
        else device.registers[device.number++] = byte;
        device.is_first = false;
        return true;
    };
    device.read = () => device.registers[device.number++];
    device.stop = (cycle) => device.log.push(['stop', cycle]);
    return device;
}

function i2c() {
    const made = machine('i2c0');
    give_pins(made, pin_function.i2c, 0, 1);
    const device = register_device();
    made.i2c[0].attach(0x68, device);
    poke(made, i2c0 + 0x04, 0x68);
    poke(made, i2c0 + 0x1c, 112); // high: 120 cycles
    poke(made, i2c0 + 0x20, 191); // low: 192
    poke(made, i2c0 + 0x6c, 1);
    const bit = 312;
    const { now } = made;
    for (const command of [0x10, 0x500, 0x100, 0x300]) poke(made, i2c0 + 0x10, command);
    made.run_for(60 * bit);
    check(
        'read',
        [0, 1, 2].map(() => peek(made, i2c0 + 0x10)),
        [0x10, 0x11, 0x12].map((n) => n ^ 0x55),
    );
    check(
        'in its time',
        device.log.map(([what, cycle]) => [what, (cycle - now) / bit]),
        [
            ['write', 10],
            ['read', 29],
            ['stop', 57],
        ],
    );
    check('the stop is reported', peek(made, i2c0 + 0x34) & 0x200, 0x200);
    for (const command of [0x20, 0x77 | 0x200]) poke(made, i2c0 + 0x10, command);
    made.run_for(30 * bit);
    check('written', device.registers[0x20], 0x77);
    poke(made, i2c0 + 0x6c, 0);
    poke(made, i2c0 + 0x04, 0x69);
    poke(made, i2c0 + 0x6c, 1);
    poke(made, i2c0 + 0x10, 0x200);
    made.run_for(30 * bit);
    check('nobody there', [peek(made, i2c0 + 0x34) & 0x40, peek(made, i2c0 + 0x80)], [0x40, 1]);
    peek(made, i2c0 + 0x54);
    check('cleared', peek(made, i2c0 + 0x34) & 0x40, 0);
    check_fault('set up while it is enabled', 'while it is enabled', () => poke(made, i2c0 + 4, 1));
    give_pins(made, 31, 0);
    check_fault('without a pin', 'no pins have its data and clock', () =>
        poke(made, i2c0 + 0x10, 0x200),
    );
}

const ms = 125_000;

function flash() {
    const made = flash_machine();
    check('its id', flash_command(made, [0x9f], 3), [0xef, 0x40, 0x15]);
    check('its own number', flash_command(made, [0x4b, 0, 0, 0, 0], 8).length, 8);
    made.flash.bytes.fill(0x77, 0x10000, 0x12000);
    check_fault('an erase without write enable', 'without write enable', () =>
        flash_command(made, [0x20, 1, 0, 0]),
    );
    flash_command(made, [0x06]);
    check('write enable', flash_command(made, [0x05], 1), [2]);
    flash_command(made, [0x20, 1, 0, 0x10]);
    check('it erases', flash_command(made, [0x05], 1)[0] & 1, 1);
    check_fault('a read meanwhile', 'while it erases', () =>
        flash_command(made, [0x03, 1, 0, 0], 1),
    );
    made.run_for(44 * ms);
    check('after 44 ms', flash_command(made, [0x05], 1)[0] & 1, 1);
    made.run_for(1.1 * ms);
    check('after 45 ms', flash_command(made, [0x05], 1), [0]);
    check('a sector is erased', flash_command(made, [0x03, 1, 0xf, 0xff], 2), [0xff, 0x77]);
    flash_command(made, [0x06]);
    flash_command(made, [0x02, 1, 0, 0xfe, 1, 2, 3]);
    made.run_for(0.8 * ms);
    check('programmed', flash_command(made, [0x03, 1, 0, 0xfe], 3), [1, 2, 0xff]);
    check('a page wraps', flash_command(made, [0x03, 1, 0, 0], 1), [3]);
    flash_command(made, [0x06]);
    flash_command(made, [0x02, 1, 0, 0xfe, 2]);
    made.run_for(0.8 * ms);
    check('programming clears bits only', flash_command(made, [0x03, 1, 0, 0xfe], 1), [0]);
}

function window() {
    const made = machine();
    made.flash.bytes.set([1, 2, 3, 4], 0x100);
    check('flash through its window', peek(made, 0x10000100), 0x04030201);
    poke(made, select_control, 2 << 8);
    check_fault('with its select overridden', 'select is overridden', () => peek(made, 0x10000100));
    const direct = flash_machine();
    check_fault('in direct mode', 'not set up for that', () => peek(direct, 0x10000100));
}

/// The flash is reached by all of its pins or not at all, and a reset takes their functions.
function flash_pins() {
    const id = [0xef, 0x40, 0x15];
    const nothing = [0xff, 0xff, 0xff];
    const made = flash_machine();
    for (const pin of [0, 2, 3, 4, 5]) {
        const control = 0x40018004 + 8 * pin;
        poke(made, control, 0x1f);
        check(`without pin ${pin}`, flash_command(made, [0x9f], 3), nothing);
        flash_command(made, [0x06]);
        poke(made, control, 0);
        check(`with pin ${pin}`, flash_command(made, [0x9f], 3), id);
    }
    check('what was sent without a pin', flash_command(made, [0x05], 1), [0]);
    poke(made, select_control, (2 << 8) | 0x1f);
    check('a select without function', made.flash.selected, false);
    const other = machine();
    restart_io_qspi(other);
    check('the window after a reset', peek(other, 0x10000100), 0xffffffff);
}

function restart_io_qspi(made) {
    poke(made, 0x4000e000, 1 << reset_bit.io_qspi);
    release(made, 'io_qspi');
}

function power_cut() {
    const made = flash_machine();
    made.flash.bytes.fill(0x00, 0x10000, 0x11000);
    flash_command(made, [0x06]);
    flash_command(made, [0x20, 1, 0, 0]);
    made.run_for(22.5 * ms);
    const left = made.cut_power();
    const erased = left.subarray(0x10000, 0x11000).filter((byte) => byte === 0xff).length;
    check_within('half of the sector is erased', erased, 2000, 2100);
    check('the rest is not', left[0x10fff], 0);
    check('the next sector is whole', left[0x11000], 0xff);
    check('the run goes on', made.flash.bytes[0x10000], 0);
}

copies();
chains();
pio_to_ring();
spi_words();
spi_pauses_and_faults();
spi_pins();
spi_by_dma();
spi_as_slave();
uart();
i2c();
flash();
window();
flash_pins();
power_cut();
finish('DMA and serial interfaces of the machine');
