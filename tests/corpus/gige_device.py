# SPDX-License-Identifier: BSD-3-Clause
"""Offers a device by GigE Vision: its control protocol at an address of its own."""
import socket
import struct
import time

from device import NOT_IMPLEMENTED, OK, Device

PORT, KEY = 3956, 0x42
DISCOVERY, READ_REGISTER, WRITE_REGISTER, READ_MEMORY, WRITE_MEMORY = 0x02, 0x80, 0x82, 0x84, 0x86
BOOTSTRAP_END = 0xA000
# It writes memory, takes actions, scheduled ones too, and follows PTP.
CAPABILITIES = 1 << 1 | 1 << 6 | 1 << 17 | 1 << 19


class GigeDevice(Device):
    def __init__(self, address, *arguments, delay_s=0, **keywords):
        self.address = address
        self.delay_s = delay_s  # of the answer to who is there
        super().__init__(*arguments, **keywords)
        connection = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        connection.bind((address, PORT))
        self.serve(connection)

    def bootstrap(self, vendor, model, kind):
        ip = struct.unpack(">I", socket.inet_aton(self.address))[0]
        self.nodes.store(0, bytes(BOOTSTRAP_END))
        for at, value in ((0x0, 0x00010002), (0x4, 0x80000001), (0x8, 0x0200), (0xC, ip),
                          (0x24, ip), (0x34, 0xFF000000), (0x600, 1), (0x904, 1), (0x908, 1),
                          (0x934, CAPABILITIES),
                          (0x938, 3000), (0x940, 1_000_000_000), (0xD04, 1500)):
            self.nodes.store(at, struct.pack(">I", value))
        for at, size, text in ((0x48, 32, vendor), (0x68, 32, model), (0x88, 32, "1.0"),
                               (0xD8, 16, "1"), (0xE8, 16, "")):
            self.nodes.store(at, text.encode()[:size - 1].ljust(size, b"\0"))
        url = f"Local:camera.{kind};{self.xml_at:X};{len(self.xml_data):X}"
        self.nodes.store(0x200, url.encode().ljust(512, b"\0"))

    def own_register(self, address):
        return address < BOOTSTRAP_END

    def answer(self, command, body):
        if command == DISCOVERY:
            return OK, self.read(0, 0xF8)
        if command == READ_REGISTER:
            return OK, b"".join(self.read(at, 4) for at, in struct.iter_unpack(">I", body))
        if command == READ_MEMORY:
            address, _, size = struct.unpack(">IHH", body[:8])
            return OK, body[:4] + self.read(address, size)
        if command == WRITE_REGISTER:
            pairs = list(struct.iter_unpack(">II", body))
            status = OK
            for at, value in pairs:
                status = status or self.write(at, struct.pack(">I", value))
            return status, struct.pack(">HH", 0, len(pairs))
        if command == WRITE_MEMORY:
            status = self.write(struct.unpack(">I", body[:4])[0], body[4:])
            return status, struct.pack(">HH", 0, len(body) - 4)
        return NOT_IMPLEMENTED, b""

    def answer_packet(self, packet):
        if len(packet) < 8 or packet[0] != KEY:
            return b""
        command, size, identity = struct.unpack(">HHH", packet[2:8])
        with self.lock:
            status, body = self.answer(command, packet[8:8 + size])
        if command == DISCOVERY:
            time.sleep(self.delay_s)
        if not packet[1] & 1:
            return b""
        return struct.pack(">HHHH", status, command + 1, len(body), identity) + body
