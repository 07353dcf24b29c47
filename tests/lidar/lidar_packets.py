# SPDX-License-Identifier: BSD-3-Clause
"""Packets of LiDARs as their manuals have them."""
import struct
import time

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


class HesaiPoints:
    """Pandar40P, Pandar64, PandarXT-32, PandarQT, OT128."""
    ports, maker = (2368, 2368), "Hesai"
    covers = 0
    period = 1_111_000

    @staticmethod
    def payload(utc, model):
        now = time.gmtime(utc // SECOND)
        us = struct.pack("<I", utc % SECOND // 1000)

        def date(since):
            return bytes([now.tm_year - since, *now[1:6]])

        tail_64 = bytes(8) + b"\x58\x02" + us + b"\x37\x42" + date(2000)
        packets = {
            "40P": (b"\xff\xee" + bytes(122)) * 10 + tail_64,
            "64": b"\xee\xff\x40\x06\x01\x04\x01\x02" + bytes(6 * 194) + tail_64 + bytes(4),
            "XT": b"\xee\xff\x06\x01".ljust(12, b"\1") + bytes(8 * 130 + 10) + b"\x37\x58\x02"
                  + date(1900) + us + b"\x42" + bytes(4),
            "QT": b"\xee\xff\x03\x02".ljust(12, b"\1") + bytes(4 * 258 + 10) + b"\x58\x02" + us
                  + b"\x37\x42" + date(1900) + bytes(4),
            "OT": b"\xee\xff\x01\x04".ljust(12, b"\1") + bytes(2 * 386 + 4 + 17 + 13)
                  + b"\x58\x02" + date(1900) + us + b"\x42" + bytes(30),
        }
        return packets[model]


class RoboSense:
    ports, maker = (6699, 6699), "RoboSense"
    covers = 0
    period = 1_328_000

    @staticmethod
    def payload(utc, model):
        now = time.gmtime(utc // SECOND)
        date = struct.pack(">6BHH", now.tm_year - 2000, *now[1:6], utc % SECOND // MS,
                           utc % MS // 1000)
        since_1970 = struct.pack(">HIi", 0, utc // SECOND, utc % SECOND // 1000)
        first = b"\x55\xaa\x05\x0a\x5a\xa5\x50\xa0" + bytes(12)
        packets = {
            "RS-16": (first + date).ljust(1248, b"\1"),
            "Helios": (first + since_1970).ljust(1248, b"\1"),
            "Ruby": (b"\x55\xaa\x05\x5a" + bytes(6) + since_1970).ljust(1248, b"\1"),
            "M1": (b"\x55\xaa\x5a\xa5" + bytes(6) + since_1970).ljust(1210, b"\1"),
        }
        return packets[model]


class Hesai:
    ports, maker = (10110, 10110), "Hesai"

    @staticmethod
    def payload(_, flags):
        sentence, lock = flags
        head = b"\xff\xee" + b"720304" + b"505950" + struct.pack("<I", 0)
        return head + b"$GPRMC,".ljust(84) + b"\xdf" * 404 + sentence + bytes([lock]) + bytes(4)
