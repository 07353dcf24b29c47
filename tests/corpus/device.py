# SPDX-License-Identifier: BSD-3-Clause
"""A device (control only) that behaves as its GenICam description says, of any protocol.

Values are stored as written; what is out of limits, not available on this model, locked or read
only is refused, as a camera would. It was left in a bad state by another program.
"""
import itertools
import select
import struct
import threading

from node_map import INTEGERS, REGISTERS, NodeMap, number

# GigE Vision and GenCP agree on these.
OK, NOT_IMPLEMENTED, INVALID_PARAMETER, INVALID_ADDRESS, ACCESS_DENIED = (
    0, 0x8001, 0x8002, 0x8003, 0x8006)
FEATURES = ("Enumeration", "Integer", "Float", "Boolean", "String")
LARGE = 0x00FFFFFF  # of a register that is a maximum: a float has 24 bits

FAILURES = (ArithmeticError, ValueError, KeyError, TypeError, struct.error)
SIDE = 480  # pixels
LARGEST_PACKET = 2048

# What another program may have left behind, where it fits: each would make wrong stamps.
LEFT_BEHIND = {"StrobeDelay": 100, "StrobeDuration": 50, "StrobeLineDelay": 100,
               "StrobeLineDuration": 50, "StrobeLinePreDelay": 10, "TriggerDelay": 500,
               "TriggerDelayAbs": 500, "AcquisitionBurstFrameCount": 3, "BinningHorizontal": 2,
               "TriggerDivider": 2, "LineInverter": 1, "SequencerMode": "On"}


VALUE = ("pValue", "pVariable", "pIndex", "pValueIndexed", "pValueDefault")
ADDRESS = ("pAddress", *VALUE)
CONDITIONS = ("pIsImplemented", "pIsAvailable", "pIsLocked")
MOST_SELECTIONS = 256  # of one register, by all its selectors


class Device:
    """Behaves as `description`. `absent` names features and entries (as "LineSelector.Out1") that
    this model does not have. A protocol says what its own registers are and answers packets."""

    def __init__(self, vendor, model, description, archive=None, absent=()):
        self.nodes = NodeMap(description)
        self.xml_data = archive or description
        self.xml_at = 0x7F000000
        self.lock = threading.Lock()
        self.refusals = []
        self.banks = {}
        self.used_selectors = {}
        self.closures = {}
        self.registers = {name: node for name, node in self.nodes.nodes.items()
                          if node.kind in REGISTERS and "pPort" in node.values}
        self.by_register = {}
        for name, node in self.nodes.nodes.items():
            if node.kind in FEATURES:
                for register in self.registers_of(name):
                    self.by_register.setdefault(register, []).append(name)
        self.power_up(vendor, model, absent)
        self.bootstrap(vendor, model, "zip" if archive else "xml")
        self.index_registers()

    def serve(self, connection):
        """Answers at the connection by a thread of its own, until close()."""
        self.connection, self.stopping = connection, False
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def close(self):
        self.stopping = True
        self.thread.join()
        self.connection.close()

    def run(self):
        while not self.stopping:
            if not select.select([self.connection], [], [], 0.05)[0]:
                continue
            packet, sender = self.connection.recvfrom(LARGEST_PACKET)
            if not packet and not sender:
                return  # the other end is gone
            if answer := self.answer_packet(packet):
                self.connection.sendmsg([answer], (), 0, sender)

    # Of a protocol.
    def bootstrap(self, vendor, model, kind):
        """Fills the protocol's own registers; `kind` of file is the description."""
        raise NotImplementedError

    def own_register(self, address):
        """Whether the protocol, not the description, says what a write to it does."""
        raise NotImplementedError

    def answer_packet(self, packet):
        """The answer to a packet of the host, or nothing."""
        raise NotImplementedError

    # Selectors that are variables of the host: the device sees only the addresses that follow.
    def find_selectors(self):
        """Values of each such variable."""
        found = {}
        for name, node in self.nodes.nodes.items():
            variable = node if node.entries else None
            while variable is not None and variable.text("pValue"):
                variable = self.nodes.nodes.get(variable.text("pValue"))
            if variable is None or "Value" not in variable.values:
                continue
            found[variable.name] = []
            for entry in node.entries:
                self.try_write(name, number(entry.text("Value")))
                found[variable.name].append(self.nodes.variables.get(variable.name, 0))
        self.nodes.variables = {}
        return found

    def selections(self, name, keys):
        """Sets the variables that a node depends on to all their values, one after the other."""
        if (name, keys) not in self.closures:
            self.closures[name, keys] = self.nodes.closure(name, keys)
        used = [n for n in self.closures[name, keys] if n in self.selectors]
        combinations = itertools.product(*(self.selectors[n] for n in used))
        for values in itertools.islice(combinations, MOST_SELECTIONS):
            self.nodes.variables = dict(zip(used, values))
            yield self.nodes.variables
        self.nodes.variables = {}

    # The state after power-up, and after another program.
    def conditions(self, keys):
        for node in self.nodes.nodes.values():
            for owner in [node, *node.entries]:
                for key in keys:
                    if owner.text(key):
                        yield owner.text(key)

    def fill(self, name, values):
        """Read-only registers that nobody set, behind a node: the first value that makes it true,
        for each selection."""
        registers = [r for r in sorted(self.nodes.closure(name, VALUE))
                     if self.nodes.nodes[r].kind in REGISTERS
                     and (r == name or "RW" not in self.nodes.nodes[r].text("AccessMode", "RO"))
                     and self.nodes.nodes[r].kind != "StringReg"]
        for _ in self.selections(name, ADDRESS) if registers else ():
            try:
                for value in values:
                    for register in registers:
                        if self.nodes.value(name):
                            break
                        if value == -1 or not self.nodes.value(register):
                            self.nodes.write_register(self.nodes.nodes[register], value)
            except FAILURES:
                pass

    def power_up(self, vendor, model, absent):
        nodes = self.nodes
        for name, text in (("DeviceVendorName", vendor), ("DeviceModelName", model)):
            self.try_write(name, text)
        self.place_registers()
        conditions = sorted(set(self.conditions(["pIsImplemented", "pIsAvailable"])))
        self.selectors = {}
        for name in conditions:
            self.fill(name, (-1, 1))
        self.selectors = self.find_selectors()  # which may depend on what there is
        for name in conditions:
            self.fill(name, (-1, 1))
        for key, value in (("pMax", LARGE), ("pInc", 1)):
            for name in sorted({n.text(key) for n in nodes.nodes.values() if n.text(key)}):
                self.fill(name, (value,))
        for name in conditions:  # addresses may have changed
            self.fill(name, (-1, 1))
        for entry in absent:
            self.take_away(entry)
        for name in ("Width", "Height", "SensorWidth", "SensorHeight", "WidthMax", "HeightMax"):
            self.try_write(name, SIDE)
        self.try_write("PayloadSize", SIDE * SIDE)
        if "PayloadSize" in nodes.nodes:
            self.fill("PayloadSize", (SIDE * SIDE,))
        for name, node in nodes.nodes.items():
            if node.kind in FEATURES:
                for _ in self.selections(name, (*ADDRESS, "pIsAvailable")):
                    self.make_valid(name, node)
        for name, value in LEFT_BEHIND.items():
            for selection in self.selections(name, ADDRESS) if name in nodes.nodes else ():
                self.leave_behind(name, value, selection)

    def place_registers(self):
        """Registers that say where others are: each gets a place of its own."""
        pointers = {name for node in self.registers.values() for text, _, _ in node.all("pAddress")
                    for name in self.nodes.closure(text, VALUE)}
        for i, name in enumerate(sorted(pointers)):
            node = self.nodes.nodes[name]
            if node.kind == "IntReg" and "RW" not in node.text("AccessMode", "RO"):
                self.nodes.write_register(node, 0x40000 + 0x1000 * i)

    def take_away(self, path):
        name, _, entry = path.partition(".")
        node = self.nodes.nodes[name]
        owner = next(e for e in node.entries if e.name == entry) if entry else node
        for register in self.nodes.closure(owner.text("pIsImplemented"), VALUE):
            if self.nodes.nodes[register].kind in REGISTERS:
                self.nodes.write_register(self.nodes.nodes[register], 0)
        assert not self.nodes.usable(owner), path

    def try_write(self, name, value):
        try:
            if name in self.nodes.nodes:
                self.nodes.write(name, value)
        except FAILURES:
            pass

    def make_valid(self, name, node):
        try:
            if self.nodes.violation(name) is None:
                return
            if node.kind == "Enumeration":
                usable = [entry for entry in node.entries if self.nodes.usable(entry)]
                if usable:
                    self.nodes.write(name, number(usable[0].text("Value")))
            elif node.kind in INTEGERS or node.kind == "Float":
                self.nodes.write(name, self.nodes.limits(name)[0])
        except FAILURES:
            pass

    def leave_behind(self, name, value, selection):
        node, before = self.nodes.nodes[name], dict(self.nodes.memory)
        if node.kind == "Enumeration":
            value = next((number(e.text("Value")) for e in node.entries if e.name == value), None)
        elif node.kind == "Boolean":
            value = number(node.text("OnValue", "1"))
        if value is not None:
            self.try_write(name, value)
        self.nodes.variables = selection
        if not self.usable(name) or self.violation(name):
            self.nodes.memory = before

    def usable(self, name):
        try:
            return self.nodes.usable(self.nodes.nodes[name])
        except FAILURES:
            return False

    def violation(self, name):
        try:
            return self.nodes.violation(name)
        except FAILURES:
            return None  # it says nothing

    # One register for several selected things: the camera keeps them apart by itself.
    def selected_registers(self, selector):
        """Registers of what it selects, with their addresses."""
        found = {}
        for name, _, _ in self.nodes.nodes[selector].all("pSelected"):
            for register in self.registers_of(name):
                try:
                    found[register] = self.nodes.address(self.nodes.nodes[register])
                except FAILURES:
                    pass
        return found

    def switch_banks(self, selector, before, registers):
        after = self.value(selector)
        if after == before:
            return
        now = self.selected_registers(selector)
        own = {self.nodes.address(self.nodes.nodes[r]) for r in self.registers_of(selector)}
        for register, address in registers.items():
            if now.get(register) != address or address in own:
                continue  # each has an address of its own, or the selector is a mode
            size = self.nodes.length(self.nodes.nodes[register])
            self.banks[selector, register, before] = self.nodes.bytes(address, size)
            if (selector, register, after) in self.banks:
                self.nodes.store(address, self.banks[selector, register, after])

    # Registers.
    def registers_of(self, name):
        """Where a feature's value is written."""
        behind = self.nodes.closure(name, ("pValue", "pValueIndexed", "pValueDefault"))
        return [n for n in sorted(behind) if self.nodes.nodes[n].kind in REGISTERS]

    def index_registers(self):
        """By word: registers whose addresses depend on nothing but the host's variables, with
        these; and the names of the others."""
        self.at_word, self.elsewhere = {}, []
        for name, node in self.registers.items():
            behind = self.nodes.closure(name, ADDRESS + ("pLength",)) - {name}
            if any(self.nodes.nodes[n].kind in REGISTERS for n in behind):
                self.elsewhere.append(name)
                continue
            for selection in self.selections(name, ADDRESS):
                try:
                    begin = self.nodes.address(node)
                    for word in range(begin // 4, (begin + self.nodes.length(node) + 3) // 4):
                        self.at_word.setdefault(word, []).append((name, selection))
                except FAILURES:
                    pass

    def covering(self, address, size):
        """Registers at these bytes; the variables are as they are for it."""
        done = set()
        for word in range(address // 4, (address + size + 3) // 4):
            for name, selection in self.at_word.get(word, ()):
                if (name, tuple(selection.items())) not in done:
                    done.add((name, tuple(selection.items())))
                    self.nodes.variables = dict(selection)
                    yield name
        for name in self.elsewhere if not done else ():
            node = self.nodes.nodes[name]
            for _ in self.selections(name, ADDRESS):
                try:
                    begin = self.nodes.address(node)
                    if begin < address + size and address < begin + self.nodes.length(node):
                        yield name
                except FAILURES:
                    continue

    def write(self, address, data):
        if self.own_register(address):
            self.nodes.store(address, data)
            return OK
        status = INVALID_ADDRESS
        before = dict(self.nodes.memory)
        for register in self.covering(address, len(data)):
            features = self.by_register.get(register, [])
            fixed = dict(self.nodes.variables)
            writable = {f: found for f in features
                        if (found := self.selection_to_write(f, fixed)) is not None}
            if features and not writable:
                status = ACCESS_DENIED if status == INVALID_ADDRESS else status
                continue
            status = self.write_features(writable, address, data, before)
            if status != OK:
                break
        if status != OK:
            self.nodes.memory = before
        self.nodes.variables = {}
        return status

    def selection_to_write(self, feature, fixed):
        """What the host may have selected for this write; None: it can never be."""
        if feature not in self.used_selectors:
            self.used_selectors[feature] = [
                n for n in self.nodes.closure(feature, (*ADDRESS, *CONDITIONS))
                if n in self.selectors]
        free = [n for n in self.used_selectors[feature] if n not in fixed]
        combinations = itertools.product(*(self.selectors[n] for n in free))
        for values in itertools.islice(combinations, MOST_SELECTIONS):
            self.nodes.variables = {**fixed, **dict(zip(free, values))}
            if self.usable(feature) and not self.nodes.locked(self.nodes.nodes[feature]):
                return self.nodes.variables
        return None

    def selected_value(self, feature, selection):
        self.nodes.variables = dict(selection)
        return self.value(feature)

    def value(self, name):
        try:
            return self.nodes.value(name)
        except FAILURES:
            return None

    def write_features(self, writable, address, data, before):
        self.nodes.memory = dict(before)
        values = {f: self.selected_value(f, selection) for f, selection in writable.items()}
        selected = {f: self.selected_registers(f) for f in writable}
        self.nodes.store(address, data)
        for feature, selection in writable.items():
            if self.selected_value(feature, selection) != values[feature]:
                if wrong := self.violation(feature):
                    self.refusals.append(wrong)
                    return INVALID_PARAMETER
                self.switch_banks(feature, values[feature], selected[feature])
        return OK

    def read(self, address, size):
        if self.xml_at <= address < self.xml_at + len(self.xml_data):
            at = address - self.xml_at
            return self.xml_data[at:at + size].ljust(size, b"\0")
        return self.nodes.bytes(address, size)

    # Judgement.
    def selected_text(self, name, selector, entry):
        """The feature's value while `entry` is selected, whatever is selected now."""
        with self.lock:
            before = dict(self.nodes.memory), dict(self.banks)
            if selector:
                node = self.nodes.nodes[selector]
                value, registers = self.value(selector), self.selected_registers(selector)
                chosen = next(e for e in node.entries if e.name == entry)
                self.nodes.write(selector, number(chosen.text("Value")))
                self.switch_banks(selector, value, registers)
            text = self.nodes.text(name)
            self.nodes.memory, self.banks = before
            self.nodes.variables = {}
            return text
