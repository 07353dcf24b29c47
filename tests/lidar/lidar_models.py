#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""lidar_models.py LIDAR_TRACE [SECONDS [SEED]]

Five LiDARs at the board's time output, each for a part of SECONDS (100000) in virtual time, while
messages are lost, late and wrong, clocks step and leap, and service and board restart: none may
read a wrong second, and no sentence may be illegal. `./dev nightly` has more SECONDS and another
SEED each time."""

import subprocess
import sys

import lidars

RMC, GGA, ZDA = 1, 2, 4

# By LiDAR: first UTC second, the one that a leap second comes before (0: none), delay in ns, pulse in
# ms, baud, sentences. New Year, 28 February of leap years and others, and the last day that two
# digits of a year can name.
CASES = {
    "velodyne": (1_798_758_000, 1_798_761_600, 0, 30, 9600, RMC),
    "ouster": (1_835_391_600, 0, 10_000, 20, 115200, RMC | GGA | ZDA),
    "livox": (1_772_308_800, 0, -250_000, 30, 9600, RMC),
    "hesai": (1_814_396_000, 1_814_400_000, 0, 30, 9600, RMC | GGA),
    "robosense": (4_102_300_000, 0, 0, 100, 9600, RMC),
}
# Time until a LiDAR has locked after each fault, and faults last: of all seconds, so many are named
# at least.
LEAST_NAMED = 0.55
# What a trace needs of memory is bounded so.
AT_A_TIME_S = 100_000


def run(trace, name, seconds, seed):
    first, leap, delay, pulse, baud, sentences = CASES[name]
    made = subprocess.run(
        [trace, *map(str, (seed, seconds, first, leap, delay, pulse * lidars.MS, baud, sentences,
                           0))], stdout=subprocess.PIPE, text=True, check=True)
    truth, pulses, sent = lidars.read_trace(made.stdout.splitlines())
    faults, lidar = lidars.judge(name, truth, pulses, sent, delay)
    unknown = sum(lidars.time_of(line)[0] is None for _, _, line in sent if line.endswith("\r\n"))
    print(f"{name}: {seconds} s, {len(pulses)} pulses, {len(lidar.named)} named, {unknown} times "
          f"unknown, longest lock {lidar.longest_lock} s, {len(truth.clocks) - 1} clock steps, "
          f"{len(faults)} faults", flush=True)
    if len({utc for _, _, utc in lidar.named}) < LEAST_NAMED * seconds:
        faults.append("too few seconds are named")
    if unknown == 0:
        faults.append("it never says that the time is unknown")
    return faults


def main():
    trace = sys.argv[1]
    seconds = int(sys.argv[2]) if len(sys.argv) > 2 else 100_000
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    print(f"seed {seed}")
    found = []
    for part in range(max(1, seconds // AT_A_TIME_S)):
        for number, name in enumerate(CASES, part * len(CASES)):
            faults = run(trace, name, min(seconds, AT_A_TIME_S) // len(CASES), seed + number)
            found += [f"{name}: seed {seed + number}: {fault}" for fault in faults]
    print("\n".join(found[:20]))
    sys.exit(1 if found else 0)


main()
