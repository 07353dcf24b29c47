// SPDX-License-Identifier: BSD-3-Clause
// When things happen: interrupts and what they cost, sleep and events, the timer, the watchdog,
// inputs and outputs; and that skipping sleep changes nothing.
import { check, check_fault, finish } from './check.mjs';
import { Machine } from './machine.mjs';
import { assemble } from './program.mjs';
import { peek, poke, release, sio_output, start_clocks } from './setup.mjs';

const us = 125; // cycles
const toggle = 0xd000001c; // r7: GPIO_OUT_XOR

/// A machine that runs `text` with GPIO 0 to 7 as outputs that are watched.
function machine_with(text, handlers = {}, options = {}) {
    const machine = new Machine(options);
    start_clocks(machine);
    release(machine, 'io_bank0', 'pads_bank0');
    for (let gpio = 0; gpio < 8; ++gpio) sio_output(machine, gpio);
    machine.watch([0, 1, 2, 3, 4, 5, 6, 7]);
    const prelude = `start: ldr r7, =${toggle}\nmovs r6, #1\nmovs r5, #2\nmovs r4, #4\n`;
    machine.start_in_ram(assemble(`${prelude}${text}\n.pool`, handlers));
    return machine;
}

/// [[cycles since `since`, level of GPIO 0 to 7], ...]
const changes = (machine, since) =>
    machine.log.map(({ cycle, levels }) => [cycle - since, levels & 255]);

function raise(machine, number, at, width = 1000) {
    machine.clock.at(at, () => machine.interrupts.set_line(number, true));
    machine.clock.at(at + width, () => machine.interrupts.set_line(number, false));
}

function enable(machine, ...numbers) {
    for (const number of numbers) poke(machine, 0xe000e100, 1 << number);
}

function set_priority(machine, number, priority) {
    const address = 0xe000e400 + (number & ~3);
    const shift = 8 * (number & 3) + 6;
    poke(machine, address, (peek(machine, address) & ~(3 << shift)) | (priority << shift));
}

function entry_and_exit() {
    const machine = machine_with('wfi\nstr r4, [r7]\nb .\nhandler: str r6, [r7]\nbx lr', {
        7: 'handler',
    });
    enable(machine, 7);
    const at = machine.now + 500;
    raise(machine, 7, at, 10);
    machine.run_for(2000);
    // Entry 15, STR 1, BX 2 and exit 12.
    check('entry and exit', changes(machine, at), [
        [15, 1],
        [30, 5],
    ]);
}

function tail_chaining() {
    const text = 'wfi\nstr r4, [r7]\nb .\nfirst: str r6, [r7]\nbx lr\nsecond: str r5, [r7]\nbx lr';
    const machine = machine_with(text, { 7: 'first', 8: 'second' });
    enable(machine, 7, 8);
    const at = machine.now + 500;
    raise(machine, 7, at, 10);
    raise(machine, 8, at, 10);
    machine.run_for(2000);
    check('two interrupts at once', changes(machine, at), [
        [15, 1],
        [25, 3],
        [40, 7],
    ]);
}

function nesting() {
    const wait = 'movs r3, #20\n1: subs r3, #1\nbne 1b\n';
    const high = 'high: str r5, [r7]\nbx lr';
    const text = `wfi\nb .\nlow: str r6, [r7]\n${wait}str r6, [r7]\nbx lr\n${high}`;
    for (const [priority, expected] of [
        [0, [1, 3, 2]],
        [1, [1, 0, 2]],
        [2, [1, 0, 2]],
    ]) {
        const machine = machine_with(text, { 7: 'low', 8: 'high' });
        enable(machine, 7, 8);
        set_priority(machine, 7, 1);
        set_priority(machine, 8, priority);
        const at = machine.now + 500;
        raise(machine, 7, at, 10);
        raise(machine, 8, at + 30, 10);
        machine.run_for(2000);
        check(
            `priority ${priority} during 1`,
            changes(machine, at).map(([, level]) => level),
            expected,
        );
    }
}

function levels_and_pending() {
    const text = 'wfi\nb .\nhandler: str r6, [r7]\nbx lr';
    const machine = machine_with(text, { 7: 'handler' });
    enable(machine, 7);
    const at = machine.now + 500;
    raise(machine, 7, at, 30); // still asserted at the first two returns
    machine.run_for(2000);
    check('a level interrupts again', changes(machine, at), [
        [15, 1],
        [25, 0],
        [35, 1],
    ]);
    poke(machine, 0xe000e180, 1 << 7);
    raise(machine, 7, machine.now + 10, 10);
    machine.run_for(100);
    check('a pending interrupt stays', peek(machine, 0xe000e200), 1 << 7);
    poke(machine, 0xe000e280, 1 << 7);
    check('until it is cleared', peek(machine, 0xe000e200), 0);
}

function systick_and_pendsv() {
    const text = 'again: wfi\nb again\ntick: str r6, [r7]\nbx lr\nsoft: str r5, [r7]\nbx lr';
    // Exceptions 15 and 14 come before the interrupts.
    const machine = machine_with(text, { [15 - 16]: 'tick', [14 - 16]: 'soft' });
    machine.run_for(50);
    const { now } = machine;
    poke(machine, 0xe000e014, 999);
    poke(machine, 0xe000e010, 7);
    machine.run_for(2500);
    check('SysTick', changes(machine, now), [
        [1015, 1],
        [2015, 0],
    ]);
    poke(machine, 0xe000e010, 0);
    poke(machine, 0xe000ed04, 1 << 28);
    machine.run_for(100);
    check('PendSV', machine.log.at(-1).levels & 255, 2);
}

function by_software() {
    const text =
        'ldr r0, =0xe000e200\nldr r1, =0x80000000\nstr r1, [r0]\nstr r4, [r7]\nb .\n' +
        'handler: str r6, [r7]\nbx lr';
    const machine = machine_with(text, { 31: 'handler' });
    enable(machine, 31);
    machine.run_for(100);
    check(
        'an interrupt of the program',
        machine.log.map(({ levels }) => levels & 255),
        [1, 5],
    );
}

function masked_sleep() {
    const text =
        'cpsid i\nwfi\nstr r5, [r7]\ncpsie i\nstr r4, [r7]\nb .\nhandler: str r6, [r7]\nbx lr';
    const machine = machine_with(text, { 7: 'handler' });
    enable(machine, 7);
    const at = machine.now + 500;
    raise(machine, 7, at, 10);
    machine.run_for(2000);
    // The pending interrupt wakes WFI, but is taken only after CPSIE.
    check('WFI with PRIMASK', changes(machine, at), [
        [0, 2],
        [17, 3],
        [32, 7],
    ]);
}

function disabled_sleep() {
    const machine = machine_with('wfi\nstr r5, [r7]\nb .');
    raise(machine, 7, machine.now + 500, 10);
    machine.run_for(2000);
    check('a disabled interrupt does not wake WFI', machine.log.length, 0);
    check('how long it slept', machine.sleep_cycles > 1900, true);
}

function events() {
    const text = 'sev\nwfe\nstr r6, [r7]\nwfe\nstr r5, [r7]\nb .\nhandler: str r4, [r7]\nbx lr';
    const machine = machine_with(text, { 7: 'handler' });
    enable(machine, 7);
    const at = machine.now + 500;
    raise(machine, 7, at, 10);
    machine.run_for(2000);
    const [[first], second, third] = changes(machine, at);
    check('WFE after SEV goes on at once', first < -400, true);
    check(
        'WFE until an interrupt',
        [second, third],
        [
            [15, 5],
            [30, 7],
        ],
    );
    const masked = machine_with('cpsid i\nwfe\nstr r6, [r7]\nb .');
    enable(masked, 7);
    raise(masked, 7, masked.now + 500, 10);
    masked.run_for(2000);
    check('a masked interrupt does not wake WFE', masked.log.length, 0);
}

const alarm_program =
    'again: wfi\nb again\nhandler: str r6, [r7]\nldr r0, =0x40054034\nstr r6, [r0]\nbx lr';

function alarms() {
    const machine = machine_with(alarm_program, { 0: 'handler' });
    enable(machine, 0);
    poke(machine, 0x40054038, 1);
    // The timer began with the tick; its next microsecond comes at a multiple of 125 from there.
    const { begin } = machine.timer;
    const target = peek(machine, 0x40054028) + 10;
    poke(machine, 0x40054010, target);
    machine.run_for(30 * us);
    check('the alarm comes with its microsecond', changes(machine, begin + target * us), [[15, 1]]);
    check('it is disarmed', peek(machine, 0x40054020), 0);
    poke(machine, 0x40054010, peek(machine, 0x40054028));
    machine.run_for(100 * us);
    check('an alarm for now waits for the next round', machine.log.length, 1);
}

function long_times() {
    const machine = machine_with(alarm_program, { 0: 'handler' });
    enable(machine, 0);
    poke(machine, 0x40054038, 1);
    poke(machine, 0x40054004, 0xffffff00);
    poke(machine, 0x40054000, 0);
    const { now } = machine;
    poke(machine, 0x40054010, 5);
    machine.run_for(0x200 * us);
    check('an alarm over the wrap of 32 bits', machine.log[0].cycle - now, (0x100 + 5) * us + 15);
    check(
        'the low word, then the high',
        [peek(machine, 0x4005400c), peek(machine, 0x40054008)],
        [0x100, 1],
    );
    check('hours are skipped', machine.run_for(3600e6 * us), 'time');
}

function watchdog() {
    const machine = machine_with('wfi\nb .');
    poke(machine, 0x40058004, 2000); // erratum: two counts per microsecond
    poke(machine, 0x4005800c, 0x1234);
    const { now } = machine;
    poke(machine, 0x4005a000, 1 << 30);
    check('the watchdog bites', machine.run_for(5000 * us), 'watchdog');
    check('after half of its counts', machine.now - now, 1000 * us);
    const next = machine.reboot({ flash: undefined });
    check('scratch words last', peek(next, 0x4005800c), 0x1234);
    check('the reason', peek(next, 0x40058008), 1);
    const fed = machine_with('wfi\nb .');
    poke(fed, 0x40058004, 2000);
    poke(fed, 0x4005a000, 1 << 30);
    for (let i = 1; i < 5; ++i)
        fed.clock.at(fed.now + 900 * i * us, () => poke(fed, 0x40058004, 2000));
    check('a fed watchdog waits', fed.run_for(4000 * us), 'time');
}

function divider() {
    const text =
        'ldr r0, =0xd0000060\nldr r1, =1000\nmovs r2, #7\nstr r1, [r0]\nstr r2, [r0, #4]\n';
    const early = `${text}ldr r3, [r0, #0x10]\nb .`;
    check_fault('a quotient too early', 'before it is ready', () =>
        machine_with(early).run_for(100),
    );
    const machine = machine_with(
        `${text}${'nop\n'.repeat(8)}ldr r3, [r0, #0x10]\nldr r1, [r0, #0x14]\nb .`,
    );
    machine.run_for(100);
    check('the divider', [...machine.processor.registers.slice(1, 4)], [1000 % 7, 7, 142]);
}

function gpio_interrupts() {
    const text =
        'wfi\nb .\nhandler: str r6, [r7]\nldr r0, =0x400140f4\n' +
        'ldr r1, =0x8000\nstr r1, [r0]\nbx lr';
    const machine = machine_with(text, { 13: 'handler' });
    enable(machine, 13);
    machine.set_input(11, 0);
    machine.run_for(10);
    poke(machine, 0x40014104, 0x8000); // rise of GPIO 11
    const at = machine.now + 500;
    machine.set_input(11, 1, at);
    machine.set_input(11, 0, at + 200);
    machine.run_for(1000);
    // The synchroniser's two cycles, and the entry.
    check('a rise interrupts once', changes(machine, at), [[17, 1]]);
}

function overrides() {
    const machine = machine_with('wfi\nb .');
    const control = 0x40014004;
    const state = () => [machine.levels & 1, machine.driven & 1];
    check('an output', state(), [0, 1]);
    poke(machine, 0xd0000014, 1);
    check('set', state(), [1, 1]);
    poke(machine, control, 5 | (1 << 8));
    check('inverted', state(), [0, 1]);
    poke(machine, control, 5 | (3 << 8));
    check('forced high', state(), [1, 1]);
    poke(machine, control, 5 | (2 << 12));
    check('high impedance, pulled down', state(), [0, 0]);
    poke(machine, control, 5);
    poke(machine, 0x4001c004, 0x80 | 0x48);
    check('output disabled, pulled up', state(), [1, 0]);
    poke(machine, 0x4001c004, 0x08);
    machine.run_for(10);
    check('input disabled', peek(machine, 0xd0000004) & 1, 0);
    check('but driven high', state(), [1, 1]);
    poke(machine, 0x4001c004, 0x48);
    machine.run_for(10);
    check('input enabled', peek(machine, 0xd0000004) & 1, 1);
    poke(machine, control, 5 | (1 << 16));
    machine.run_for(10);
    check('input inverted', peek(machine, 0xd0000004) & 1, 0);
    poke(machine, control, 5);
    poke(machine, 0xd0000018, 1);
    check('driven low against the pull-up', state(), [0, 1]);
    machine.run_for(10);
    const { now } = machine;
    poke(machine, 0xd0000014, 1);
    machine.run_until(now + 2);
    check('an output is not yet seen', peek(machine, 0xd0000004) & 1, 0);
    machine.run_until(now + 3);
    check('an output is seen', peek(machine, 0xd0000004) & 1, 1);
    poke(machine, control, 31);
    check('no function', state(), [1, 0]);
}

function blocks_put_into_reset() {
    const machine = machine_with('wfi\nb .');
    release(machine, 'pio0');
    poke(machine, 0x400140a4, 6); // GPIO 20
    poke(machine, 0x502000dc, (1 << 26) | (20 << 5));
    poke(machine, 0x502000d8, 0xe081); // SET PINDIRS, 1
    check('a pin of the PIO', (machine.driven >>> 20) & 1, 1);
    poke(machine, 0x4000e000, 1 << 10);
    check('is free when the PIO is in reset', (machine.driven >>> 20) & 1, 0);
}

function wires() {
    const machine = machine_with('wfi\nb .');
    machine.wire(0, 12);
    const { now } = machine;
    poke(machine, 0xd0000014, 1);
    machine.run_until(now + 2);
    check('a wire is not seen at once', peek(machine, 0xd0000004) & 0x1000, 0);
    machine.run_until(now + 3);
    check('but behind the synchroniser', peek(machine, 0xd0000004) & 0x1000, 0x1000);
    poke(machine, 0xd0000028, 1);
    machine.run_for(5);
    check('a wire that nobody drives', peek(machine, 0xd0000004) & 0x1000, 0);
}

function skipping() {
    const text =
        'again: wfi\nb again\nalarm: str r6, [r7]\nldr r0, =0x40054034\nstr r6, [r0]\n' +
        'ldr r0, =0x40054010\nldr r1, [r0]\nadds r1, #13\nstr r1, [r0]\nbx lr\n' +
        'edge: str r5, [r7]\nldr r0, =0x400140f4\nldr r1, =0x8000\nstr r1, [r0]\nbx lr';
    const [fast, naive] = [false, true].map((is_naive) => {
        const machine = machine_with(text, { 0: 'alarm', 13: 'edge' }, { naive: is_naive });
        enable(machine, 0, 13);
        poke(machine, 0x40054038, 1);
        poke(machine, 0x40014104, 0x8000);
        for (let i = 1; i < 100; ++i) machine.set_input(11, i & 1, machine.now + 1237 * i);
        poke(machine, 0x40054010, peek(machine, 0x40054028) + 5);
        machine.run_for(200_000);
        return machine;
    });
    check('enough happened', fast.log.length > 150, true);
    check('skipping changes nothing', fast.log, naive.log);
    check('nor how long it slept', fast.sleep_cycles, naive.sleep_cycles);
}

entry_and_exit();
tail_chaining();
nesting();
levels_and_pending();
by_software();
systick_and_pendsv();
masked_sleep();
disabled_sleep();
events();
alarms();
long_times();
watchdog();
divider();
gpio_interrupts();
overrides();
blocks_put_into_reset();
wires();
skipping();
finish('times of the machine');
