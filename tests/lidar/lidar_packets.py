# SPDX-License-Identifier: BSD-3-Clause
"""Packets of LiDARs as their manuals have them."""
import struct

MS = 1_000_000
SECOND = 1_000 * MS


class Velodyne:
    ports, maker = (2368, 2368), "Velodyne"
    covers = 1_327_104
    period = 1_327_104

    @staticmethod
    def payload(utc, _):
        blocks = (b"\xff\xee" + bytes(98)) * 12
        return blocks + struct.pack("<IBB", utc % (3600 * SECOND) // 1000, 0x37, 0x22)


class VelodynePosition:
    ports, maker = (8308, 8308), "Velodyne"

    @staticmethod
    def payload(utc, status):
        return (bytes(198) + struct.pack("<IB3x", utc % (3600 * SECOND) // 1000, status)
                + b"$GPRMC,,V,,,,,,,,,,N*53\r\n").ljust(512, b"\0")


class Livox:
    ports, maker = (56300, 56301), "Livox"
    covers = 460_000
    period = 480_000

    @staticmethod
    def payload(utc, time_type):
        size = 36 + 96 * 14
        return struct.pack("<BHHHHBBB12xIq", 0, size, 4600, 96, 7, 1, 1, time_type, 0,
                           utc) + bytes(size - 36)


class Ouster:
    ports, maker = (7502, 7502), "Ouster"
    covers = 1_500_000
    period = 1_562_500

    @staticmethod
    def payload(utc, legacy):
        if legacy:
            return b"".join(struct.pack("<qHHI", utc + i * 97_656, i, 3, 0).ljust(788, b"\1")
                            for i in range(16))
        return struct.pack("<HH28x", 1, 9) + struct.pack("<qHH", utc, 0, 1) + bytes(8000)


class Hesai:
    ports, maker = (10110, 10110), "Hesai"

    @staticmethod
    def payload(_, flags):
        sentence, lock = flags
        head = b"\xff\xee" + b"720304" + b"505950" + struct.pack("<I", 0)
        return head + b"$GPRMC,".ljust(84) + b"\xdf" * 404 + sentence + bytes([lock]) + bytes(4)
