// SPDX-License-Identifier: BSD-3-Clause
// The boot ROM: starts the second stage from flash as the ROM does, and stands in for the few ROM
// functions that firmware may call.
import { fault, hex } from './fault.mjs';

const boot2_size = 256;
const boot2_begin = 0x20041f00;
const boot2_stack = 0x20042000;

// The ROM's own places: where its tables are found, by the datasheet.
const magic_at = 0x10;
const functions_pointer_at = 0x14;
const data_pointer_at = 0x16;
const lookup_pointer_at = 0x18;
const functions_at = 0x100;
const data_at = 0x1f0;
const code_begin = 0x200; // the stand-ins, two bytes each

const lookup_cycles = 40; // about what a search takes

const code_of = (name) => name.charCodeAt(0) | (name.charCodeAt(1) << 8);
// Functions of the ROM; all but the first are refused when they are called.
const function_names = [
    'UB',
    'P3',
    'R3',
    'L3',
    'T3',
    'MS',
    'S4',
    'MC',
    'C4',
    'IF',
    'EX',
    'RE',
    'RP',
    'FC',
    'CX',
    'WV',
];

const crc_polynomial = 0x04c11db7;

export function boot2_crc(bytes) {
    let crc = 0xffffffff;
    for (const byte of bytes) {
        crc = (crc ^ (byte << 24)) >>> 0;
        for (let bit = 0; bit < 8; ++bit)
            crc = ((crc << 1) ^ (crc >>> 31 ? crc_polynomial : 0)) >>> 0;
    }
    return crc;
}

export class BootRom {
    /// `on_boot_loader(activity_gpio_mask, disabled_interfaces)` is called by reset_usb_boot.
    constructor(bus, processor, on_boot_loader) {
        this.bus = bus;
        this.processor = processor;
        this.on_boot_loader = on_boot_loader;
        this.functions = new Map();
        this.write_tables();
        bus.is_rom_function = (address) => this.functions.has(address);
        bus.call_rom = (address) => this.call(address);
    }

    write_tables() {
        const view = new DataView(this.bus.rom.buffer);
        view.setUint32(magic_at, 0x0301754d, true); // 'M', 'u', 1, version 3
        view.setUint16(functions_pointer_at, functions_at, true);
        view.setUint16(data_pointer_at, data_at, true);
        view.setUint16(lookup_pointer_at, code_begin | 1, true);
        this.functions.set(code_begin, () => this.look_up());
        function_names.forEach((name, index) => {
            const address = code_begin + 2 * (index + 1);
            view.setUint16(functions_at + 4 * index, code_of(name), true);
            view.setUint16(functions_at + 4 * index + 2, address | 1, true);
            this.functions.set(address, () => this.refuse(name));
        });
        this.functions.set(code_begin + 2, () => this.enter_boot_loader());
    }

    call(address) {
        return this.functions.get(address)();
    }

    refuse(name) {
        fault(
            `the ROM's function '${name}' is called, which is not modelled; it would run from ` +
                `${hex(this.processor.registers[14])}`,
        );
    }

    look_up() {
        const { registers } = this.processor;
        let at = registers[0];
        const wanted = registers[1] & 0xffff;
        for (; ; at += 4) {
            const code = this.bus.read16(at);
            if (code === wanted || code === 0) {
                registers[0] = code === 0 ? 0 : this.bus.read16(at + 2);
                break;
            }
        }
        this.processor.return_from_rom();
        return lookup_cycles;
    }

    enter_boot_loader() {
        const { registers } = this.processor;
        this.on_boot_loader(registers[0], registers[1]);
        return 1;
    }

    /// Starts what is in flash, or says why the ROM would not.
    start(flash) {
        const bytes = flash.subarray(0, boot2_size);
        const expected = new DataView(bytes.buffer, bytes.byteOffset).getUint32(252, true);
        const found = boot2_crc(bytes.subarray(0, boot2_size - 4));
        if (found !== expected) {
            const numbers = `${hex(found)}, not ${hex(expected)}`;
            fault(`the flash begins with no valid boot2: the CRC of its 252 bytes is ${numbers}`);
        }
        this.bus.ram.set(bytes, boot2_begin - 0x20000000);
        this.processor.start(boot2_stack, boot2_begin);
        this.processor.registers[14] = 0; // boot2 knows by it that the ROM called it
    }
}
