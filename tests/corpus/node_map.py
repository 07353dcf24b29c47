# SPDX-License-Identifier: BSD-3-Clause
"""A GenICam description over a register memory, evaluated by itself: a judge of what a host did.

Shares no code with the service or with Aravis. Knows what cameras' descriptions use (GenICam
standard 2.0): registers, masks, structures, selectors by index and address, SwissKnives,
converters, enumerations, limits, increments, conditions and locks.
"""
import struct
import xml.etree.ElementTree as ElementTree

from formula import Formula

INTEGERS = ("Integer", "IntReg", "MaskedIntReg", "StructEntry", "IntConverter", "IntSwissKnife")
REGISTERS = ("IntReg", "MaskedIntReg", "FloatReg", "StringReg", "Register", "StructEntry")


def tag(element):
    return element.tag.split("}")[-1]


class Node:
    """One node: its tag, and texts of its children by tag, in their order."""

    def __init__(self, element, parent=None):
        self.kind = tag(element)
        self.name = element.get("Name")
        self.values = {}
        self.children = list(element)
        for child in [*element, *(parent if parent is not None else [])]:
            if tag(child) not in ("EnumEntry", "StructEntry"):
                self.values.setdefault(tag(child), []).append(
                    ((child.text or "").strip(), dict(child.attrib), child))
        self.entries = [Node(child) for child in element if tag(child) == "EnumEntry"]

    def text(self, key, default=None):
        return self.values[key][0][0] if key in self.values else default

    def all(self, *keys):
        return [value for key in keys for value in self.values.get(key, [])]


def number(text):
    text = text.strip()
    try:
        return int(text, 0)
    except ValueError:
        return float(text)


class NodeMap:
    def __init__(self, description):
        self.memory = {}
        self.variables = {}  # values that a host keeps by itself, as selectors of some makers
        self.nodes = {}
        self.formulas = {}
        self.seen = set()
        root = ElementTree.fromstring(description)
        self.collect(root)

    def collect(self, element):
        for child in element:
            if tag(child) == "StructReg":
                for entry in child:
                    if tag(entry) == "StructEntry":
                        self.nodes[entry.get("Name")] = Node(entry, child)
            elif child.get("Name") and tag(child) not in ("EnumEntry", "pVariable"):
                self.nodes[child.get("Name")] = Node(child)
            if tag(child) == "Group":
                self.collect(child)

    # Memory.
    def bytes(self, address, size):
        return bytes(self.memory.get(address + i, 0) for i in range(size))

    def store(self, address, data):
        for i, byte in enumerate(data):
            self.memory[address + i] = byte

    def closure(self, name, keys, seen=None):
        """A node, and all that it comes from by references of these kinds."""
        seen = set() if seen is None else seen
        node = self.nodes.get(name)
        if node is not None and name not in seen:
            seen.add(name)
            for key in keys:
                for text, _, _ in node.all(key):
                    self.closure(text, keys, seen)
            for _, _, element in node.all("IntSwissKnife"):
                for text, _, _ in Node(element).all("pVariable"):
                    self.closure(text, keys, seen)
        return seen

    # Registers.
    def address(self, node):
        total = sum(number(text) for text, _, _ in node.all("Address"))
        total += sum(self.value(name) for name, _, _ in node.all("pAddress"))
        for _, _, element in node.all("IntSwissKnife"):
            total += self.knife(Node(element))
        for name, attributes, _ in node.all("pIndex"):
            offset = (self.value(attributes["pOffset"]) if "pOffset" in attributes
                      else number(attributes["Offset"]) if "Offset" in attributes
                      else self.length(node))
            total += self.value(name) * offset
        return int(total)

    def length(self, node):
        name = node.text("pLength")
        return int(self.value(name) if name else number(node.text("Length", "4")))

    def bits(self, node):
        """Lowest bit and their count, from the least significant; GenICam counts big-endian
        registers from the other end."""
        size = 8 * self.length(node)
        if "Bit" in node.values:
            low = high = number(node.text("Bit"))
        else:
            low, high = number(node.text("LSB", "0")), number(node.text("MSB", str(size - 1)))
        if self.big(node):
            low, high = size - 1 - low, size - 1 - high
        return min(low, high), abs(high - low) + 1

    def big(self, node):
        return node.text("Endianess", "LittleEndian") == "BigEndian"

    def raw(self, node):
        data = self.bytes(self.address(node), self.length(node))
        return int.from_bytes(data, "big" if self.big(node) else "little")

    def read_register(self, node):
        if node.kind in ("StringReg", "Register"):
            return self.bytes(self.address(node), self.length(node)).split(b"\0")[0].decode(
                errors="replace")
        order = ">" if self.big(node) else "<"
        if node.kind == "FloatReg":
            size = self.length(node)
            return struct.unpack(order + ("f" if size == 4 else "d"),
                                 self.bytes(self.address(node), size))[0]
        value, width = self.raw(node), 8 * self.length(node)
        if node.kind != "IntReg":
            low, width = self.bits(node)
            value = value >> low & (1 << width) - 1
        signed = node.text("Sign") == "Signed" and value >> (width - 1)
        return value - (1 << width) if signed else value

    def write_register(self, node, value):
        address, size = self.address(node), self.length(node)
        order = "big" if self.big(node) else "little"
        if node.kind in ("StringReg", "Register"):
            return self.store(address, value.encode()[:size].ljust(size, b"\0"))
        if node.kind == "FloatReg":
            form = (">" if self.big(node) else "<") + ("f" if size == 4 else "d")
            return self.store(address, struct.pack(form, value))
        value = int(value)
        if node.kind != "IntReg":
            low, width = self.bits(node)
            mask = (1 << width) - 1
            value = self.raw(node) & ~(mask << low) | (value & mask) << low
        return self.store(address, (value & (1 << 8 * size) - 1).to_bytes(size, order))

    # Values.
    def formula(self, text):
        if text not in self.formulas:
            self.formulas[text] = Formula(text)
        return self.formulas[text]

    def names(self, node, extra=()):
        variables = {attributes["Name"]: name
                     for name, attributes, _ in node.all("pVariable") if "Name" in attributes}
        constants = {attributes["Name"]: number(text)
                     for text, attributes, _ in node.all("Constant")}
        expressions = {attributes["Name"]: text
                       for text, attributes, _ in node.all("Expression")}
        extra = dict(extra)

        def lookup(name):
            if name in extra:
                return extra[name]
            if name in constants:
                return constants[name]
            if name in expressions:
                return self.formula(expressions[name])(lookup)
            target = variables[name]
            if name.endswith(".Min") or name.endswith(".Max"):
                return self.limits(target)[name.endswith(".Max")]
            return self.value(target)
        return lookup

    def knife(self, node):
        value = self.formula(node.text("Formula"))(self.names(node))
        return int(value) if node.kind == "IntSwissKnife" else value

    def value(self, name):
        node = self.nodes[name]
        if name in self.seen:
            return 0  # a loop by conditions: the host's check refuses real ones
        self.seen.add(name)
        try:
            return self.value_of(node)
        finally:
            self.seen.discard(name)

    def value_of(self, node):
        if node.kind in REGISTERS:
            return self.read_register(node)
        if node.kind in ("SwissKnife", "IntSwissKnife"):
            return self.knife(node)
        if node.kind in ("Converter", "IntConverter"):
            source = self.value(node.text("pValue"))
            value = self.formula(node.text("FormulaFrom"))(self.names(node, [("TO", source)]))
            return int(value) if node.kind == "IntConverter" else value
        if node.kind == "Boolean":
            on = number(node.text("OnValue", "1"))
            value = (self.value(node.text("pValue")) if node.text("pValue")
                     else number(node.text("Value").replace("true", "1").replace("false", "0")))
            return value == on
        if node.text("pIndex"):
            index = str(self.value(node.text("pIndex")))
            for text, attributes, _ in node.all("pValueIndexed"):
                if attributes.get("Index") == index:
                    return self.value(text)
            for text, attributes, _ in node.all("ValueIndexed"):
                if attributes.get("Index") == index:
                    return number(text)
            name = node.text("pValueDefault")
            return self.value(name) if name else number(node.text("ValueDefault", "0"))
        if node.text("pValue"):
            return self.value(node.text("pValue"))
        if node.name in self.variables:
            return self.variables[node.name]
        text = node.text("Value", "0")
        return text if node.kind == "String" else number(text)

    def write(self, name, value):
        """Past all limits, as a camera does at power-up."""
        node = self.nodes[name]
        if node.kind in REGISTERS:
            self.write_register(node, value)
        elif node.kind in ("Converter", "IntConverter"):
            raw = self.formula(node.text("FormulaTo"))(self.names(node, [("FROM", value)]))
            self.write(node.text("pValue"), raw)
        elif node.text("pValue"):
            self.write(node.text("pValue"), value)
        else:
            self.variables[name] = value

    def limits(self, name):
        node = self.nodes[name]
        inner = node.text("pValue")
        low, high = (self.limits(inner) if inner and self.nodes[inner].kind in (
            "Integer", "Float", "IntConverter", "Converter") and "Converter" not in node.kind
            else (None, None))
        for key, position in (("Min", 0), ("Max", 1)):
            limit = (self.value(node.text("p" + key)) if node.text("p" + key)
                     else number(node.text(key)) if node.text(key) else None)
            if limit is not None:
                low, high = (limit, high) if position == 0 else (low, limit)
        return low, high

    def condition(self, node, key, default):
        name = node.text(key)
        return bool(self.value(name)) if name else default

    def usable(self, node):
        """Implemented and available, with what its value comes from."""
        if not (self.condition(node, "pIsImplemented", True)
                and self.condition(node, "pIsAvailable", True)):
            return False
        inner = self.nodes.get(node.text("pValue"))
        return inner is None or self.usable(inner)

    def locked(self, node):
        if self.condition(node, "pIsLocked", False) or "RO" in (
                node.text("ImposedAccessMode"), node.text("AccessMode")):
            return True
        inner = self.nodes.get(node.text("pValue"))
        return inner is not None and self.locked(inner)

    def text(self, name):
        """As a host shows it."""
        node, value = self.nodes[name], self.value(name)
        if node.kind == "Enumeration":
            for entry in node.entries:
                if number(entry.text("Value")) == value:
                    return entry.name
            return f"?{value}"
        if isinstance(value, bool):
            return str(value).lower()
        return value if isinstance(value, str) else f"{value:.10g}"

    def violation(self, name):
        """Why the value that a feature has now cannot be; None: it can."""
        node, value = self.nodes[name], self.value(name)
        if node.kind == "Enumeration":
            entries = [entry for entry in node.entries if number(entry.text("Value")) == value]
            if not any(self.usable(entry) for entry in entries):
                return f"{name} has no entry {value} on this model"
        elif node.kind in ("Integer", "Float", *INTEGERS, "Converter"):
            low, high = self.limits(name)
            if low is not None and value < low or high is not None and value > high:
                return f"{name} = {value} is not within {low} to {high}"
            step = (self.value(node.text("pInc")) if node.text("pInc")
                    else number(node.text("Inc", "0")))
            if node.kind == "Integer" and step > 1 and (value - (low or 0)) % step != 0:
                return f"{name} = {value} is no multiple of {step}"
        return None
