// SPDX-License-Identifier: BSD-3-Clause
// What the chip would not forgive ends the run, each with an error that says what and where.
import { boot2_crc } from './boot.mjs';
import { check, check_fault, finish } from './check.mjs';
import { Machine, flash_image } from './machine.mjs';
import { assemble } from './program.mjs';

const run_cycles = 2000;

function run(text, options = {}) {
    const machine = new Machine(options);
    machine.start_in_ram(assemble(`start:\n${text}\n.pool`));
    const why = machine.run_for(run_cycles);
    return { machine, why };
}

/// Loads r0 with `address` and r1 with `value`, then executes `text`.
const with_registers = (address, value, text) =>
    `ldr r0, =${address}\nldr r1, =${value}\n${text}\nb .`;

function accesses() {
    const read = (address) => () => run(with_registers(address, 0, 'ldr r2, [r0]'));
    const write =
        (address, text = 'str r1, [r0]') =>
        () =>
            run(with_registers(address, 0, text));
    check_fault('SPI in reset', 'spi0 is in reset', read('0x4003c000'));
    check_fault('PIO in reset', 'pio1 is in reset', write('0x50300000'));
    check_fault('USB memory in reset', 'usb is in reset', write('0x50100080'));
    check_fault('an alias of a block in reset', 'timer is in reset', write('0x40056038'));
    check_fault('nothing there', 'nothing is at 0x60000000', read('0x60000000'));
    check_fault('behind RAM', 'nothing is at 0x20042000', read('0x20042000'));
    check_fault('write to ROM', 'write to ROM', write('0x100'));
    check_fault('write to flash', 'write to flash', write('0x10000100'));
    check_fault('behind the flash', 'behind its end', read('0x10200000'));
    check_fault('unaligned read', 'unaligned read of 4 bytes at 0x20000002', read('0x20000002'));
    check_fault(
        'unaligned half',
        'unaligned write of 2 bytes',
        write('0x20001001', 'strh r1, [r0]'),
    );
    check_fault('an unknown register', 'no register 0xff0', read('0x4000cff0'.replace('c', '8')));
}

function too_early() {
    const release = 'ldr r0, =0x4000f000\nldr r1, =0x200000\nstr r1, [r0]\n'; // TIMER
    const use = 'ldr r0, =0x40054000\nldr r2, [r0, #0x28]\nb .';
    check_fault('a block used before RESET_DONE', 'timer is in reset', () => run(release + use));
    const wait = 'ldr r0, =0x4000c008\n1: ldr r2, [r0]\ntst r2, r1\nbeq 1b\n';
    check('used after RESET_DONE', run(release + wait + use).why, 'time');
}

function instructions() {
    check_fault('an undefined instruction', 'refused: instruction 0xde01', () => run('udf #1'));
    check_fault('a breakpoint', 'refused: instruction 0xbe00', () => run('bkpt #0'));
    check_fault('SVC', 'refused: instruction 0xdf00', () => run('svc #0'));
    check_fault('a jump into nothing', 'execution where no code is, at 0x40000000', () =>
        run('ldr r0, =0x40000001\nbx r0'),
    );
    check_fault('a jump without Thumb bit', 'no Thumb code', () =>
        run('ldr r0, =0x20000100\nbx r0'),
    );
    const jump = 'ldr r0, =0x10000001\nbx r0';
    check_fault('flash when only RAM is allowed', 'execution outside of RAM', () => {
        const machine = new Machine();
        machine.start_in_ram(assemble(`start:\n${jump}\n.pool`));
        machine.processor.ram_only = true;
        machine.run_for(run_cycles);
    });
    check_fault('a vector without Thumb bit', 'no Thumb code', () =>
        run(
            'ldr r0, =0xe000e100\nmovs r1, #1\nstr r1, [r0]\n' +
                'ldr r0, =0xe000e200\nstr r1, [r0]\nb .',
        ),
    );
    const { why, machine } = run('udf #1', { on_fault() {} });
    check('on_fault instead of an exception', why, 'fault');
    check('where it happened', machine.where().startsWith('at the instruction 0x200000c0'), true);
}

function setup() {
    check_fault('a PLL without crystal', 'before its crystal is stable', () =>
        run(
            'ldr r0, =0x4000f000\nldr r1, =0x1000\nstr r1, [r0]\n' +
                'ldr r0, =0x4000c008\n1: ldr r2, [r0]\ntst r2, r1\nbeq 1b\n' +
                'ldr r0, =0x40028000\nmovs r1, #125\nstr r1, [r0, #8]\n' +
                'movs r1, #0\nstr r1, [r0, #4]\nb .',
        ),
    );
    check_fault('a wrong clk_sys', 'clk_sys would run at 0 Hz', () =>
        run(with_registers('0x4000803c', 1, 'str r1, [r0]')),
    );
    check_fault('clk_ref from a crystal that does not run', 'before that is stable', () =>
        run(with_registers('0x40008030', 2, 'str r1, [r0]')),
    );
}

/// A flash whose second stage is `text`.
function flash_with(text, breaks_crc = false) {
    const code = assemble(`start:\n${text}\n.pool`).subarray(192);
    const flash = new Uint8Array(4096).fill(0xff);
    flash.fill(0, 0, 256);
    flash.set(code, 0);
    const view = new DataView(flash.buffer);
    view.setUint32(252, boot2_crc(flash.subarray(0, 252)) + (breaks_crc ? 1 : 0), true);
    return flash;
}

function boot() {
    check('CRC of the datasheet', boot2_crc(Buffer.from('123456789')), 0x0376e6e7);
    check_fault(
        'a wrong CRC',
        'no valid boot2',
        () => new Machine({ flash: flash_with('b .', true) }),
    );
    const stays = new Machine({ flash: flash_with('b .') });
    check('boot2 runs', stays.run_for(100), 'time');
    check('where boot2 runs', stays.processor.pc, 0x20041f00);
    // Looks 'UB' up as firmware does and calls it.
    const reset_to_boot =
        'movs r3, #0x14\nldrh r0, [r3]\nldr r1, =0x4255\nldrh r3, [r3, #4]\n' +
        'blx r3\nmov r3, r0\nmovs r0, #0\nmovs r1, #0\nblx r3\nb .';
    const leaves = new Machine({ flash: flash_with(reset_to_boot) });
    check('the boot loader is asked for', leaves.run_for(1000), 'boot loader');
    const erase = reset_to_boot.replace('0x4255', '0x4552');
    check_fault("the ROM's erase", "the ROM's function 'RE'", () =>
        new Machine({ flash: flash_with(erase) }).run_for(1000),
    );
}

/// A block of UF2 with 256 bytes of `byte`.
function uf2_block(address, byte, family = 0xe48bff56) {
    const block = new Uint8Array(512);
    const view = new DataView(block.buffer);
    [0x0a324655, 0x9e5d5157, 0x2000, address, 256, 0, 1, family].forEach((word, i) =>
        view.setUint32(4 * i, word, true),
    );
    block.fill(byte, 32, 288);
    view.setUint32(508, 0x0ab16f30, true);
    return block;
}

function images() {
    const image = flash_image(uf2_block(0x10001000, 7));
    check(
        'a block of UF2',
        [image[0xfff], image[0x1000], image[0x10ff], image[0x1100]],
        [255, 7, 7, 255],
    );
    const refused = (what, words, bytes) => check_fault(what, words, () => flash_image(bytes));
    refused('another family', 'not for the RP2040', uf2_block(0x10000000, 0, 1));
    refused('into RAM', 'not in flash', uf2_block(0x20000000, 0));
    refused('a torn file', 'per block', uf2_block(0x10000000, 0).subarray(0, 500));
}

function resets() {
    const bites = run('ldr r0, =0x40058000\nldr r1, =0x80000000\nstr r1, [r0]\nb .');
    check('the watchdog is triggered', bites.why, 'watchdog');
    check('its reason', bites.machine.watchdog.reason, 2);
    check(
        'a reset by AIRCR',
        run(with_registers('0xe000ed0c', '0x05fa0004', 'str r1, [r0]')).why,
        'reset',
    );
}

accesses();
too_early();
instructions();
setup();
boot();
images();
resets();
finish('faults of the machine');
