# SPDX-License-Identifier: BSD-3-Clause
"""What a board is made of: footprints, components, parts, nets. Lengths are mm, y points down."""
from __future__ import annotations

import dataclasses
import math
import uuid

NAMESPACE = uuid.UUID("6c0a2e0e-6d0b-5d3f-8a52-94a9d6c1b0aa")


def stamp(*names: object) -> str:
    """The same names give the same identifier, so that files can be compared."""
    return str(uuid.uuid5(NAMESPACE, "/".join(str(name) for name in names)))


Box = tuple[float, float, float, float]
Mark = tuple[str, float, float, int]  # text, place in the footprint's own terms, turn


@dataclasses.dataclass(frozen=True)
class Pad:
    number: str
    x: float
    y: float
    width: float
    height: float
    drill: float = 0.0  # of a hole; 0: on the surface
    shape: str = "roundrect"
    plated: bool = True
    shift: tuple[float, float] = (0.0, 0.0)  # of the copper against the hole
    paste: bool = True


@dataclasses.dataclass(frozen=True)
class Footprint:
    name: str
    pads: tuple[Pad, ...]
    courtyard: Box
    body: Box
    height: float = 1.0  # of the part above the board
    library: str = ""  # the footprint of KiCad's library that its pads are compared with
    hole: float = 0.0  # of a mounting hole
    turn: float = 0.0  # by which the pool's machines turn it more than KiCad does
    kind: str = "smd"
    escape: float = 0.0  # how far tracks lead straight out of narrow pads


@dataclasses.dataclass(frozen=True)
class Pin:
    number: str
    name: str
    kind: str  # power_in, power_out, input, output, open_collector, bidirectional, passive, nc
    supply: str = ""  # name of the supply pin that gives its levels
    ioff: bool = False  # without supply, no current flows in


@dataclasses.dataclass(frozen=True)
class Component:
    """What can be ordered. `figures` are of the data sheet that `source` names."""
    name: str
    footprint: str
    pins: tuple[Pin, ...]
    mpn: str = ""
    maker: str = ""
    source: str = ""
    alternates: tuple[str, ...] = ()
    usd: float = 0.01  # price class in tens, not an offer
    family: str = ""
    figures: tuple[tuple[str, float], ...] = ()
    symbol: str = "box"
    mates: tuple[str, ...] = ()  # of a connector: housing and contact of the cable

    def figure(self, name: str) -> float:
        return dict(self.figures)[name]


@dataclasses.dataclass
class Part:
    ref: str
    component: Component
    nets: dict[str, str]  # by pin number
    sheet: str
    group: str
    value: str
    fitted: frozenset[str]  # the variants that have it
    near: str = ""  # "REF.PIN": placed as close to it as possible
    label: str = ""  # on the silk screen, of a connector or jumper
    marks: tuple[Mark, ...] = ()  # words at its pins
    delivered: str = ""  # where the shunt of a jumper is at delivery; empty: there is none
    words: dict[str, str] = dataclasses.field(default_factory=dict)  # of a connector: use by pin

    def net(self, name: str) -> str:
        """Of a pin, by its name or number."""
        for pin in self.component.pins:
            if name in (pin.name, pin.number):
                return self.nets.get(pin.number, "")
        raise KeyError(f"{self.ref} has no pin {name}")


@dataclasses.dataclass(frozen=True)
class Place:
    x: float
    y: float
    turn: int = 0  # degrees, counter-clockwise as KiCad counts


@dataclasses.dataclass(frozen=True)
class Rail:
    """A supply: its volts at least, usually and at most, and how many mA it may give."""
    least: float
    usual: float
    most: float
    milliamps: float


@dataclasses.dataclass
class Board:
    name: str
    title: str
    width: float
    height: float
    variants: tuple[str, ...] = ("standard",)
    parts: dict[str, Part] = dataclasses.field(default_factory=dict)
    sheets: list[tuple[str, str]] = dataclasses.field(default_factory=list)
    rails: dict[str, Rail] = dataclasses.field(default_factory=dict)
    places: dict[str, Place] = dataclasses.field(default_factory=dict)
    planes: dict[str, str] = dataclasses.field(default_factory=dict)  # net by layer
    texts: list[tuple[float, float, float, str]] = dataclasses.field(default_factory=list)
    islands: dict[str, Box] = dataclasses.field(default_factory=dict)  # isolated ground: area
    layers: int = 4

    def sheet(self, name: str, title: str) -> None:
        self.sheets.append((name, title))

    def add(self, ref: str, component: Component, group: str, *, value: str = "",
            fitted: tuple[str, ...] = (), near: str = "", label: str = "",
            marks: tuple[Mark, ...] = (), delivered: str = "",
            words: dict[str, str] | None = None, named: dict[str, str] | None = None,
            **nets: str) -> Part:
        """Pins by name; pins that share a name share the net. As keywords: _1 for pin 1."""
        if ref in self.parts:
            raise ValueError(f"{ref} exists twice")
        wanted = {name.removeprefix("_"): net for name, net in nets.items()} | (named or {})
        found: dict[str, str] = {}
        for pin in component.pins:
            net = wanted.get(pin.name, wanted.get(pin.number, ""))
            if net:
                found[pin.number] = net
        known = {text for pin in component.pins for text in (pin.name, pin.number)}
        if set(wanted) - known:
            raise ValueError(f"{ref} has no pin {sorted(set(wanted) - known)}")
        part = Part(ref, component, found, self.sheets[-1][0], group, value or component.name,
                    frozenset(fitted or self.variants), near, label, marks, delivered,
                    words or {})
        self.parts[ref] = part
        return part

    def pins_of(self, net: str) -> list[tuple[Part, Pin]]:
        return [(part, pin) for part in self.parts.values() for pin in part.component.pins
                if part.nets.get(pin.number) == net]

    def nets(self) -> list[str]:
        return sorted({net for part in self.parts.values() for net in part.nets.values() if net})


def turned(x: float, y: float, degrees: float) -> tuple[float, float]:
    """A point of a footprint after it was turned; y points down, so counter-clockwise is this."""
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    return (round(x * cosine + y * sine, 4), round(-x * sine + y * cosine, 4))


def box_at(box: Box, place: Place) -> Box:
    corners = [turned(x, y, place.turn) for x in (box[0], box[2]) for y in (box[1], box[3])]
    return (place.x + min(x for x, _ in corners), place.y + min(y for _, y in corners),
            place.x + max(x for x, _ in corners), place.y + max(y for _, y in corners))


def pad_at(pad: Pad, place: Place) -> tuple[float, float]:
    """Centre of its copper."""
    x, y = turned(pad.x + pad.shift[0], pad.y + pad.shift[1], place.turn)
    return place.x + x, place.y + y


def pad_box(pad: Pad, place: Place) -> Box:
    x, y = pad_at(pad, place)
    width, height = (pad.width, pad.height) if place.turn % 180 == 0 else (pad.height, pad.width)
    return x - width / 2, y - height / 2, x + width / 2, y + height / 2


def gap(first: Box, second: Box) -> float:
    """Between two boxes; 0 if they touch."""
    dx = max(first[0] - second[2], second[0] - first[2], 0)
    dy = max(first[1] - second[3], second[1] - first[3], 0)
    return math.hypot(dx, dy)
