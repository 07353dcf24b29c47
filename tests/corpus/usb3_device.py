# SPDX-License-Identifier: BSD-3-Clause
"""Offers a device by USB3 Vision: its control protocol, in packets of a unix socket that
corpus_usb puts on a bus."""
import socket
import struct

from device import INVALID_PARAMETER, NOT_IMPLEMENTED, OK, Device

MAGIC = 0x43563355  # "U3VC"
HEADER = struct.Struct("<IHHHH")  # magic, flags or status, command, bytes that follow, number
ACKNOWLEDGE = 1 << 14
READ_MEMORY, WRITE_MEMORY = 0x0800, 0x0802
LARGEST_PACKET = 1024
PATIENCE_S = 60  # with the bus

# Places of bootstrap registers: where descriptions that name them have them, else where there is
# nothing else.
SBRM, STREAM_CHANNELS = 0x10000, 0x1C
SIRM, SIRM_SIZE = 0x20002000, 0x30
MANIFEST = 0x7E000000
TIMESTAMP_LATCH = 0x1F8
XML, ZIP = 0, 1
CAPABILITIES = 0x101  # time stamps; a name that users give

# Place, bytes and value of bootstrap registers that no camera should have, and what is said of it.
DAMAGES = [
    ((SBRM + 0x18, 4, 12), "its control packets have 12 bytes"),
    ((SIRM, 4, 21 << 24), "its transfers are multiples of 2^21 bytes"),
    ((SIRM + 0x8, 8, 0), "announces frames of 0 bytes"),
    ((SIRM + 0x10, 4, 0xFFFFFFFF), "leader or trailer of its frames have 4294967295 bytes"),
    ((MANIFEST + 0x18, 8, 1 << 62), "its description has 4611686018427387904 bytes"),
    ((MANIFEST + 0xC, 4, 0x01010000 | ZIP << 10), "its description is refused")]


class Usb3Device(Device):
    def __init__(self, serial, path, *arguments, **keywords):
        self.serial = serial
        super().__init__(*arguments, **keywords)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        listener.bind(path)
        listener.listen()
        listener.settimeout(PATIENCE_S)
        self.listener = listener

    def start(self):
        """Once the bus is there."""
        self.serve(self.listener.accept()[0])
        self.listener.close()

    def bootstrap(self, vendor, model, kind):
        sbrm = SBRM
        if "NumberOfStreamChannels_Reg" in self.nodes.nodes:
            channels = self.nodes.nodes["NumberOfStreamChannels_Reg"]
            sbrm = self.nodes.address(channels) - STREAM_CHANNELS
        for at, text in ((0x4, vendor), (0x44, model), (0xC4, "1.0"), (0x144, self.serial)):
            self.nodes.store(at, text.encode()[:63].ljust(64, b"\0"))
        payload = self.value("PayloadSize")
        for at, size, value in (
                (0x0, 4, 0x00010001), (0x1C4, 8, CAPABILITIES), (0x1CC, 4, 1000),
                (0x1D0, 8, MANIFEST), (0x1D8, 8, sbrm), (0x1FC, 4, 1),
                (sbrm, 4, 0x00010000), (sbrm + 0x4, 8, 1), (sbrm + 0x14, 4, LARGEST_PACKET),
                (sbrm + 0x18, 4, LARGEST_PACKET), (sbrm + STREAM_CHANNELS, 4, 1),
                (sbrm + 0x20, 8, SIRM), (sbrm + 0x28, 4, SIRM_SIZE), (sbrm + 0x40, 4, 8),
                (SIRM, SIRM_SIZE, 0), (SIRM + 0x8, 8, int(payload or 0)), (SIRM + 0x10, 4, 52),
                (SIRM + 0x14, 4, 32),
                (MANIFEST, 8, 1), (MANIFEST + 0x8, 4, 0x01000000),
                (MANIFEST + 0xC, 4, 0x01010000 | (ZIP if kind == "zip" else XML) << 10),
                (MANIFEST + 0x10, 8, self.xml_at), (MANIFEST + 0x18, 8, len(self.xml_data)),
                (MANIFEST + 0x20, 32, 0)):
            self.put(at, size, value)

    def put(self, address, size, value):
        self.nodes.store(address, value.to_bytes(size, "little"))

    def own_register(self, address):
        return SIRM <= address < SIRM + SIRM_SIZE or address == TIMESTAMP_LATCH

    def answer(self, command, body):
        if command == READ_MEMORY:
            address, _, size = struct.unpack("<QHH", body)
            if HEADER.size + size > LARGEST_PACKET:
                return INVALID_PARAMETER, b""
            return OK, self.read(address, size)
        if command == WRITE_MEMORY:
            status = self.write(struct.unpack("<Q", body[:8])[0], body[8:])
            return status, struct.pack("<HH", 0, len(body) - 8)
        return NOT_IMPLEMENTED, b""

    def answer_packet(self, packet):
        if len(packet) < HEADER.size:
            return b""
        magic, flags, command, size, identity = HEADER.unpack(packet[:HEADER.size])
        if magic != MAGIC:
            return b""
        with self.lock:
            status, body = self.answer(command, packet[HEADER.size:HEADER.size + size])
        if not flags & ACKNOWLEDGE:
            return b""
        return HEADER.pack(MAGIC, status, command + 1, len(body), identity) + body
