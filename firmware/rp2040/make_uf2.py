#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes an UF2 file, for the boot loader, of what belongs into the flash of an RP2040.

The boot ROM wants a check sum behind its second stage, and `versavis flash` one at the end of all:
they are put there.
"""
import pathlib
import struct
import sys
import zlib

FLASH_BEGIN = 0x10000000
STAGE_SIZE = 256
PAYLOAD_SIZE = 256
BLOCK_SIZE = 512
FAMILY_RP2040 = 0xE48BFF56
HAS_FAMILY = 0x2000
MAGIC = (0x0A324655, 0x9E5D5157)
MAGIC_END = 0x0AB16F30
SEAL = 0x4C535656  # as in libversavis/wire/flash_map.hpp
# Of the image in flash. At half, the firmware does not fit; at twice, what is too much goes unseen.
SIZE_LIMIT = 64 * 1024


def check_sum(data):
    """CRC-32 as the boot ROM computes it: most significant bit first, without a final inversion."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C11DB7 if crc & 0x80000000 else 0)) & 0xFFFFFFFF
    return crc


def sealed(image):
    """The image in whole pages, with the check sum of its second stage, and the seal at its end."""
    stage = image[: STAGE_SIZE - 4]
    image = stage + struct.pack("<I", check_sum(stage)) + image[STAGE_SIZE:]
    image += b"\xff" * (-(len(image) + 8) % PAYLOAD_SIZE) + struct.pack("<I", SEAL)
    return image + struct.pack("<I", zlib.crc32(image))


def blocks(image):
    count = len(image) // PAYLOAD_SIZE
    for number in range(count):
        begin = number * PAYLOAD_SIZE
        payload = image[begin : begin + PAYLOAD_SIZE]
        head = struct.pack("<8I", *MAGIC, HAS_FAMILY, FLASH_BEGIN + begin, PAYLOAD_SIZE, number,
                           count, FAMILY_RP2040)
        yield (head + payload).ljust(BLOCK_SIZE - 4, b"\0") + struct.pack("<I", MAGIC_END)


def main(binary, uf2):
    image = sealed(pathlib.Path(binary).read_bytes())
    if len(image) > SIZE_LIMIT:
        sys.exit(f"make_uf2: {binary} has {len(image)} bytes, more than {SIZE_LIMIT}")
    pathlib.Path(uf2).write_bytes(b"".join(blocks(image)))
    print(f"{uf2}: {len(image)} bytes of flash")


main(*sys.argv[1:])
