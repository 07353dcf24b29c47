#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""lidar_chip.py IMAGE.uf2 EMULATOR_DIRECTORY NODE...

The firmware as it is flashed, on the emulated chip: what five LiDARs read from the levels of its
pins. A serial line is decoded bit by bit, as its receiver does."""

import subprocess
import sys

import lidars

RMC, GGA, ZDA = 1, 2, 4
SERIAL_INVERTED = 4

# By LiDAR: seconds, first UTC second, pulse in ms, baud, sentences, whether the line rests low.
CASES = {
    "velodyne": (20, 1_798_761_590, 30, 9600, RMC, True),
    "ouster": (8, 1_835_481_594, 20, 115200, RMC | GGA | ZDA, False),
    "livox": (8, 1_772_323_195, 30, 9600, RMC, False),
    "hesai": (8, 1_814_399_995, 30, 4800, RMC | GGA, True),
    "robosense": (8, 1_798_761_595, 100, 9600, RMC, True),
}


def decode(edges, baud, inverted):
    """(begin, end, byte) of the characters on a line, from its changes (at, level): 8N1, each bit
    read in its middle. Raises ValueError at a stop bit that is none."""
    rest = 0 if inverted else 1
    bit = 1e9 / baud
    characters = []
    index, level, free = 0, rest, 0

    def level_at(instant):
        nonlocal index, level
        while index < len(edges) and edges[index][0] <= instant:
            level = edges[index][1]
            index += 1
        return level

    while index < len(edges):
        at, new = edges[index]
        level_at(at)
        if new == rest or at < free:
            continue
        byte = 0
        for number in range(8):
            if level_at(at + (1.5 + number) * bit) == rest:
                byte |= 1 << number
        if level_at(at + 9.5 * bit) != rest:
            raise ValueError(f"no stop bit at {at}")
        free = at + 9.5 * bit
        characters.append((at, round(at + 10 * bit), byte))
    return characters


def sentences_of(characters):
    """(begin, end, text) of each line."""
    sent, line = [], []
    for begin, end, byte in characters:
        line.append((begin, end, byte))
        if byte == ord("\n"):
            text = bytes(each[2] for each in line).decode("latin-1")
            sent.append((line[0][0], end, text))
            line = []
    if line:
        raise ValueError("a line without an end")
    return sent


def run(command, name):
    seconds, first, pulse, baud, sentences, inverted = CASES[name]
    flags = SERIAL_INVERTED if inverted else 0
    made = subprocess.run(
        command + [str(each) for each in (seconds, first, pulse * lidars.MS, baud, sentences,
                                          flags)],
        stdout=subprocess.PIPE, text=True, check=True)
    lines = made.stdout.splitlines()
    begins = min(int(line.split()[1]) for line in lines if line.startswith("announced"))
    bits = [tuple(map(int, line.split()[1:])) for line in lines if line.startswith("bit")]
    bits = [edge for edge in bits if edge[0] > begins]  # before, nothing is sent
    truth, pulses, _ = lidars.read_trace(lines)
    sent = sentences_of(decode(bits, baud, inverted))
    faults, lidar = lidars.judge(name, truth, pulses, sent, tolerance=1_000)
    reported = [int(line.split()[1]) for line in lines if line.startswith("reported")]
    print(f"{name}: {len(pulses)} pulses, {len(lidar.named)} named, {len(sent)} sentences, "
          f"{len(faults)} faults", flush=True)
    # One announcement is the first, and one says that the time is unknown: so two seconds each.
    if len(pulses) < seconds - 5 or len({rise for rise, _, _ in lidar.named}) != len(pulses):
        faults.append("pulses are missing, or not named")
    if any(abs(rise - report) > 100 for (rise, _), report in zip(pulses, reported)):
        faults.append("the board reports other instants")
    if len(reported) != len(pulses):
        faults.append(f"the board reports {len(reported)} pulses")
    if not any(lidars.time_of(line)[0] is None for _, _, line in sent):
        faults.append("it never says that the time is unknown")
    return [f"{name}: {fault}" for fault in faults]


def main():
    image, emulator, *node = sys.argv[1:]
    found = [fault for name in CASES
             for fault in run([*node, f"{emulator}/lidar_trace.mjs", image], name)]
    print("\n".join(found))
    sys.exit(1 if found else 0)


main()
