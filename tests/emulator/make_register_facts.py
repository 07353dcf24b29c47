#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes firmware/emulator/register_facts.mjs of the vendor's description of the chip.

usage: make_register_facts.py RP2040.svd COMMIT > firmware/emulator/register_facts.mjs

The description is src/rp2040/hardware_regs/RP2040.svd of https://github.com/raspberrypi/pico-sdk at
COMMIT. Only facts are taken over: addresses, reset values, and which bits do what.
"""
import re
import sys
import xml.etree.ElementTree

# What neither the firmware uses nor the emulator has is left out.
LEFT_OUT = {"ADC", "PWM", "RTC", "USB_DPRAM", "SPARE_IRQ"}

HEAD = """// SPDX-License-Identifier: BSD-3-Clause
// What the vendor says of each register. Made by tests/emulator/make_register_facts.py of
// src/rp2040/hardware_regs/RP2040.svd, https://github.com/raspberrypi/pico-sdk, commit
// {commit}.
//
// A block: its name and address. A register: name, offset, value after reset (- where none is
// stated), bits that can be written, bits that writing 1 clears; all in hex. Of several: `xCOUNT`
// and the distance; `*` in the name counts them.
export const register_facts = `
"""


def bits_of(field):
    high, low = re.fullmatch(r"\[(\d+):(\d+)\]", field.findtext("bitRange")).groups()
    return (1 << int(high) + 1) - (1 << int(low))


def facts_of(register):
    """Reset value, bits that can be written, bits that writing 1 clears."""
    writable = clears = 0
    for field in register.find("fields"):
        if field.findtext("access") == "read-only":
            continue
        if field.findtext("modifiedWriteValues") == "oneToClear":
            clears |= bits_of(field)
        else:
            writable |= bits_of(field)
    reset = register.findtext("resetValue")
    return ("-" if reset is None else f"{int(reset, 16):x}", f"{writable:x}", f"{clears:x}")


def run_at(registers, first, number):
    """How many registers go on counting this number of the first's name, and their distance."""
    name, offset, facts = first
    head, tail = name[: number.start()], name[number.end() :]
    by_name = {other: (at, other_facts) for other, at, other_facts in registers}
    distance = None
    count = 1
    while True:
        found = by_name.get(f"{head}{int(number.group()) + count}{tail}")
        if found is None or found[1] != facts:
            break
        distance = distance or found[0] - offset
        if found[0] != offset + count * distance:
            break
        count += 1
    return count, distance, head, tail


def lines_of(registers):
    left = list(registers)
    while left:
        name, offset, facts = left[0]
        runs = [(run_at(left, left[0], number), number) for number in re.finditer(r"\d+", name)
                if int(number.group()) == 0]
        (count, distance, head, tail), _ = max(
            runs, key=lambda run: run[0][0], default=((1, None, name, ""), None))
        words = [name, f"{offset:x}", *facts]
        if count > 1:
            words = [f"{head}*{tail}", f"{offset:x}", *facts, f"x{count}", f"{distance:x}"]
        yield " ".join(words)
        names = {f"{head}{i}{tail}" for i in range(count)} if count > 1 else {name}
        left = [each for each in left if each[0] not in names]


def main(svd, commit):
    peripherals = {each.findtext("name"): each for each in
                   xml.etree.ElementTree.parse(svd).getroot().find("peripherals")}
    print(HEAD.format(commit=commit), end="")
    for name, peripheral in peripherals.items():
        if name in LEFT_OUT:
            continue
        print(f"block {name} {int(peripheral.findtext('baseAddress'), 16):x}")
        like = peripheral.get("derivedFrom")
        registers = (peripherals[like] if like else peripheral).find("registers")
        for line in lines_of([(each.findtext("name"), int(each.findtext("addressOffset"), 16),
                               facts_of(each)) for each in registers]):
            print(line)
    print("`;")


main(*sys.argv[1:])
