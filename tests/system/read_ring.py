#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Reads frames of a stream, written from docs/contracts/shm-layout.md alone.

read_ring.py FILE COUNT: prints item number, output time, trigger, size, corrected delay, gain and
temperature of each frame.
Exits 0 after COUNT intact frames, 1 if FILE is not a ring or they do not arrive in ten seconds.
"""
import fcntl
import mmap
import os
import socket
import stat
import struct
import sys
import time

SEALS = 1 | 2 | 4 | 16  # seal, shrink, grow, future write
F_GET_SEALS = 1034


def unpack(memory, layout, offset):
    return struct.unpack_from("<" + layout, memory, offset)


def opened(path):
    """A descriptor of the segment."""
    if not stat.S_ISSOCK(os.lstat(path).st_mode):
        return os.open(path, os.O_RDONLY)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as door:
        door.settimeout(5)
        door.connect(path)
        _, (descriptor,), _, _ = socket.recv_fds(door, 1, 1)
    if fcntl.fcntl(descriptor, F_GET_SEALS) & SEALS != SEALS:
        sys.exit(f"{path}: not sealed")
    return descriptor


def writer_is_dead(memory, minor):
    """By its process alone, as far as that can be judged from here."""
    (pid,) = unpack(memory, "I", 48)
    (start,) = unpack(memory, "Q", 56)
    pid_namespace, time_namespace = unpack(memory, "QQ", 176)
    if minor < 5 or pid_namespace != os.stat("/proc/self/ns/pid").st_ino:
        return False
    try:
        with open(f"/proc/{pid}/stat", encoding="utf-8") as stat_file:
            fields = stat_file.read().rpartition(")")[2].split()  # from the third on
    except FileNotFoundError:
        return True
    comparable = minor >= 8 and time_namespace == os.stat("/proc/self/ns/time").st_ino
    return fields[0] == "Z" or (comparable and int(fields[19]) != start)


def main(path, count):
    descriptor = opened(path)
    memory = mmap.mmap(descriptor, 0, prot=mmap.PROT_READ)
    magic, major, minor, total = unpack(memory, "8sIIQ", 0)
    if magic != b"VERSAVIS" or major != 1 or total != os.fstat(descriptor).st_size:
        sys.exit(f"{path}: not a ring of version 1")
    if unpack(memory, "I", 512)[0] != 1 or writer_is_dead(memory, minor):
        sys.exit(f"{path}: its writer is dead")
    descriptors, slots, slot_size = unpack(memory, "IIQ", 64)
    descriptors_at, generations_at, slots_at = unpack(memory, "QQQ", 80)
    number = unpack(memory, "Q", 256)[0]
    deadline = time.monotonic() + 10
    while count > 0 and time.monotonic() < deadline:
        if unpack(memory, "Q", 256)[0] <= number:
            time.sleep(0.002)
            continue
        at = descriptors_at + number % descriptors * 128
        sequence, generation, length_and_slot, output_time = unpack(memory, "QQQq", at)
        (trigger,) = unpack(memory, "Q", at + 32)
        (delay,) = unpack(memory, "i", at + 32 + 88)
        _sigma, width, height, stride = unpack(memory, "IIII", at + 32 + 56)
        length, slot = length_and_slot >> 32, length_and_slot & 0xFFFFFFFF
        complete = sequence == 2 * number + 2 == unpack(memory, "Q", at)[0]
        if complete and slot < slots and length <= slot_size:
            begin = slots_at + slot * slot_size
            pixels = memory[begin : begin + length]
            gain, temperature = unpack(memory, "ff", generations_at + 64 * slot + 8)
            (generation_now,) = unpack(memory, "Q", generations_at + 64 * slot)
            if generation_now == generation and len(pixels) == stride * height:
                size = f"{width} x {height}"
                sensor = f", {gain} dB, {temperature} C" if minor >= 6 else ""
                print(f"{number} {output_time} trigger {trigger}: {size}, {delay} ns taken off"
                      + sensor)
                count -= 1
        number += 1
    return 0 if count == 0 else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
