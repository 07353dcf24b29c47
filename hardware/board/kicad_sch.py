# SPDX-License-Identifier: BSD-3-Clause
"""Writes the circuit as sheets of KiCad 6. Parts stand in groups; names join the nets."""
from __future__ import annotations

import dataclasses
import textwrap
from typing import Any

from model import Board, Component, Part, Pin, stamp
from sexpr import q, write

Sexpr = list[Any]
GRID = 2.54
TITLES = {"imu_chip": "Optional IMU on the board", "uart": "IMU on the UART", "imu": "IMU on SPI "
          "or I2C", "gnss": "PPS and NMEA in", "aux": "Auxiliary pulses", "sync": "Sync and test",
          "pico": "Raspberry Pi Pico", "power": "7 to 24 V, USB, 1.8 V, clamp",
          "camera_supply": "Fuses", "light": "Light, limited in time", "mechanics": "Holes"}
NOTES = {
    "power": "Input, clamp, eFuse (off below 6.5 V, above 30 V and when reversed; 2 A), 5 V "
             "converter. USB feeds +5V through the diode on the Pico.",
    "camera": "Trigger: Pico, rest resistor, 74LVC1T45, 47R, connector. Exposure: connector, 4k7, "
              "clamp, Schmitt trigger, 74LVC1T45, Pico.",
    "isolated": "Fitted for 24 V: then the 74LVC1T45 of the channel's exposure is not.",
    "lidar": "Polarity by jumper (XOR), then 3.3 or 5 V by jumper.",
    "gnss": "Inputs bear 24 V and RS-232; NMEA INV for RS-232.",
    "light": "The capacitor ends each pulse after 8 to 17 ms, whatever the firmware does.",
    "imu": "SPI and I2C share pins: one of the two connectors.",
    "uart": "The jumper RX chooses between this connector and GNSS.",
    "camera_supply": "The input's voltage, fused; never on a connector with signals."}
PAPERS = (("A4", 297.0, 210.0), ("A3", 420.0, 297.0), ("A2", 594.0, 420.0))
SMALL = {"resistor", "capacitor", "diode", "zener", "led", "fuse", "inductor", "tvs"}


@dataclasses.dataclass(frozen=True)
class PinSpot:
    """Where a wire meets the symbol; y grows upwards, as in KiCad's libraries."""
    pin: Pin
    x: float
    y: float
    side: str


@dataclasses.dataclass(frozen=True)
class Symbol:
    name: str
    spots: tuple[PinSpot, ...]
    width: float
    height: float


def ground(pin: Pin) -> bool:
    return pin.name.startswith(("GND", "AGND", "RTN", "EP", "MP"))


def sides(component: Component) -> tuple[list[Pin], list[Pin]]:
    pins = [pin for pin in component.pins]
    if component.name == "Raspberry Pi Pico":
        return pins[:20], list(reversed(pins[20:]))
    if component.family in ("connector", "jumper", "test_point"):
        return [], pins
    left = [p for p in pins if p.kind in ("power_in", "input") and not ground(p)]
    if component.family == "t45":
        left = [p for p in pins if p.name.startswith(("VCCA", "A", "DIR"))]
    rest = [p for p in pins if p not in left and not ground(p)]
    left += [p for p in pins if ground(p)]
    return left, rest


def symbol_of(component: Component) -> Symbol:
    if component.symbol in SMALL:
        return Symbol(component.name, tuple(PinSpot(pin, x, 0.0, side) for pin, x, side in zip(
            component.pins, (-5.08, 5.08), ("left", "right"))), 10.16, 5.08)
    left, right = sides(component)
    rows = max(len(left), len(right), 1)
    names = [max((len(p.name) for p in side), default=0) for side in (left, right)]
    width = max(GRID * round((sum(names) * 1.1 + 6) / GRID), 4 * GRID)
    if not left:
        width = 3 * GRID
    width = 2 * GRID * round(width / (2 * GRID))
    top = GRID * (rows - 1) / 2
    top = GRID * round(top / GRID)
    spots = [PinSpot(pin, -width / 2 - GRID, top - GRID * i, "left") for i, pin in enumerate(left)]
    spots += [PinSpot(pin, width / 2 + GRID, top - GRID * i, "right")
              for i, pin in enumerate(right)]
    return Symbol(component.name, tuple(spots), width, GRID * rows)


def font(size: float = 1.27) -> Sexpr:
    return ["effects", ["font", ["size", size, size]]]


def hidden(size: float = 1.27) -> Sexpr:
    return [*font(size), "hide"]


def stroke(width: float = 0.254) -> Sexpr:
    return ["stroke", ["width", width], ["type", "default"], ["color", 0, 0, 0, 0]]


def polyline(points: list[tuple[float, float]], fill: str = "none") -> Sexpr:
    return ["polyline", ["pts", *(["xy", x, y] for x, y in points)], stroke(),
            ["fill", ["type", fill]]]


def box(x: float, y: float, fill: str = "background") -> Sexpr:
    return ["rectangle", ["start", -x, y], ["end", x, -y], stroke(), ["fill", ["type", fill]]]


DIODE = [polyline([(-1.27, 1.27), (-1.27, -1.27)]),
         polyline([(1.27, 1.27), (1.27, -1.27), (-1.27, 0), (1.27, 1.27)]),
         polyline([(-2.54, 0), (2.54, 0)])]
DRAWN: dict[str, list[Sexpr]] = {
    "resistor": [box(2.54, 1.016, "none")], "fuse": [box(2.54, 0.762, "none"),
                                                     polyline([(-2.54, 0), (2.54, 0)])],
    "capacitor": [polyline([(-0.508, 2.032), (-0.508, -2.032)]),
                  polyline([(0.508, 2.032), (0.508, -2.032)]),
                  polyline([(-2.54, 0), (-0.508, 0)]), polyline([(0.508, 0), (2.54, 0)])],
    "inductor": [["arc", ["start", x, 0.0], ["mid", x + 0.635, 0.635], ["end", x + 1.27, 0.0],
                  stroke(), ["fill", ["type", "none"]]] for x in (-2.54, -1.27, 0.0, 1.27)],
    "diode": DIODE, "zener": [*DIODE, polyline([(-1.27, 1.27), (-0.762, 1.27)])],
    "led": [*DIODE, polyline([(2.0, -1.0), (3.0, -2.0), (2.4, -2.0)])],
    "tvs": [polyline([(0, 1.27), (0, -1.27)]),
            polyline([(-2.54, 1.27), (0, 0), (-2.54, -1.27), (-2.54, 1.27)]),
            polyline([(2.54, 1.27), (0, 0), (2.54, -1.27), (2.54, 1.27)])]}


def library_symbol(component: Component) -> Sexpr:
    symbol = symbol_of(component)
    name = symbol_name(component)
    small = component.symbol in SMALL
    body: Sexpr = DRAWN[component.symbol] if small else [box(
        symbol.width / 2, max(abs(s.y) for s in symbol.spots) + GRID if symbol.spots else GRID)]
    doubled = {s.pin.number for i, s in enumerate(symbol.spots) if s.pin.kind == "power_out" and
               any(o.pin.name == s.pin.name for o in symbol.spots[:i])}
    pins = [["pin", "passive" if s.pin.number in doubled else kind_of(s.pin), "line",
             ["at", s.x, s.y, 0 if s.side == "left" else 180], ["length", 2.54],
             ["name", q("~" if small else s.pin.name), font()], ["number", q(s.pin.number),
                                                               font(1.0)]]
            for s in symbol.spots]
    hide: Sexpr = [["pin_numbers", "hide"], ["pin_names", "hide"]]
    beside: Sexpr = [["pin_names", ["offset", 0.762]]]
    return ["symbol", q(f"versavis:{name}"), *(hide if small else beside), ["in_bom", "yes"],
            ["on_board", "yes"],
            ["property", q("Reference"), q("U"), ["id", 0], ["at", 0, 0, 0], font()],
            ["property", q("Value"), q(component.name), ["id", 1], ["at", 0, 0, 0], font()],
            ["property", q("Footprint"), q(f"versavis:{component.footprint}"), ["id", 2],
             ["at", 0, 0, 0], hidden()],
            ["property", q("Datasheet"), q(component.source), ["id", 3], ["at", 0, 0, 0], hidden()],
            ["symbol", q(f"{name}_0_1"), *body], ["symbol", q(f"{name}_1_1"), *pins]]


def symbol_name(component: Component) -> str:
    return f"{component.name}_{component.footprint}".replace(" ", "_").replace("/", "_")


def kind_of(pin: Pin) -> str:
    return {"nc": "no_connect"}.get(pin.kind, pin.kind)


GROUND = ["symbol", q("versavis:GND"), ["power"], ["pin_names", ["offset", 0]], ["in_bom", "yes"],
          ["on_board", "yes"],
          ["property", q("Reference"), q("#PWR"), ["id", 0], ["at", 0, -5, 0], hidden()],
          ["property", q("Value"), q("GND"), ["id", 1], ["at", 0, -3.81, 0], font()],
          ["property", q("Footprint"), q(""), ["id", 2], ["at", 0, 0, 0], hidden()],
          ["property", q("Datasheet"), q(""), ["id", 3], ["at", 0, 0, 0], hidden()],
          ["symbol", q("GND_0_1"), polyline([(0, 0), (0, -1.27), (1.27, -1.27), (0, -2.54),
                                             (-1.27, -1.27), (0, -1.27)])],
          ["symbol", q("GND_1_1"), ["pin", "power_in", "line", ["at", 0, 0, 270], ["length", 0],
                                    "hide", ["name", q("GND"), font()], ["number", q("1"),
                                                                         font()]]]]


FLAG = ["symbol", q("versavis:PWR_FLAG"), ["power"], ["pin_names", ["offset", 0]],
        ["in_bom", "yes"], ["on_board", "yes"],
        ["property", q("Reference"), q("#FLG"), ["id", 0], ["at", 0, 5, 0], hidden()],
        ["property", q("Value"), q("PWR_FLAG"), ["id", 1], ["at", 0, 3.81, 0], hidden()],
        ["property", q("Footprint"), q(""), ["id", 2], ["at", 0, 0, 0], hidden()],
        ["property", q("Datasheet"), q(""), ["id", 3], ["at", 0, 0, 0], hidden()],
        ["symbol", q("PWR_FLAG_0_1"), polyline([(0, 0), (0, 1.27), (-1.27, 1.9), (0, 2.54),
                                                (1.27, 1.9), (0, 1.27)])],
        ["symbol", q("PWR_FLAG_1_1"), ["pin", "power_out", "line", ["at", 0, 0, 90],
                                       ["length", 0], "hide", ["name", q("pwr"), font()],
                                       ["number", q("1"), font()]]]]


def flagged(board: Board) -> list[str]:
    """Nets that supply chips through connectors, jumpers or diodes: KiCad's ERC needs a word."""
    found = []
    for net in board.nets():
        kinds = {pin.kind for _, pin in board.pins_of(net)}
        if "power_in" in kinds and "power_out" not in kinds:
            found.append(net)
    return found


class Sheet:
    """One sheet: parts flow down its columns, group by group."""

    def __init__(self, board: Board, name: str, title: str, page: int):
        self.board, self.name, self.title, self.page = board, name, title, page
        self.rows: list[Sexpr] = []
        self.parts = [part for part in board.parts.values() if part.sheet == name]
        self.grounds = 0
        self.paper = "A4"

    @property
    def path(self) -> str:
        return f"/{stamp(self.board.name, 'sheet', self.name)}"

    def draw(self) -> str:
        self.flow()
        used = {symbol_name(part.component): part.component for part in self.parts}
        library = ["lib_symbols", *(library_symbol(used[name]) for name in sorted(used)), GROUND,
                   FLAG]
        return write(["kicad_sch", ["version", "20211123"], ["generator", "versavis"],
                      ["uuid", stamp(self.board.name, "page", self.name)], ["paper", q(self.paper)],
                      title_block(self.board, self.title), library, *self.rows]) + "\n"

    def flow(self) -> None:
        """On the smallest paper that holds all groups and leaves its title block free."""
        groups = list(dict.fromkeys(part.group for part in self.parts))
        blocks = [(group, *arrange([part for part in self.parts if part.group == group]))
                  for group in groups]
        for self.paper, wide, high in PAPERS:
            spots = flowed([(width, height) for _, width, height, _ in blocks], wide - 20)
            if max(y + block[2] for (_, y), block in zip(spots, blocks)) < high - 48:
                break
        for (x, y), (group, width, height, parts) in zip(spots, blocks):
            self.frame(x, y, width, height, group)
            for part, (px, py) in parts:
                self.place(part, snap(x + px), snap(y + py))
        if self.page == 2:
            self.flags(max(y + block[2] for (_, y), block in zip(spots, blocks)) + 17.78)

    def flags(self, y: float) -> None:
        """In a row below the groups of the first sheet."""
        x = 33.02
        for i, net in enumerate(flagged(self.board)):
            place = snap(x + 22.86 * (i % 7)), snap(y + 10.16 * (i // 7))
            self.rows.append(["global_label", q(net), ["shape", "passive"], ["at", *place, 180],
                              ["fields_autoplaced"],
                              ["effects", ["font", ["size", 1.1, 1.1]], ["justify", "right"]],
                              ["uuid", stamp(self.board.name, net, "flag label")]])
            self.rows.append(power_symbol("PWR_FLAG", f"#FLG{i + 1:02}", place, 0,
                                          stamp(self.board.name, net, "flag")))

    def frame(self, x: float, y: float, width: float, height: float, group: str) -> None:
        title = TITLES.get(group, group_title(group))
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)]
        for a, b in zip(corners, corners[1:]):
            self.rows.append(["polyline", ["pts", ["xy", *a], ["xy", *b]],
                              ["stroke", ["width", 0], ["type", "dash"], ["color", 0, 0, 0, 0]],
                              ["uuid", stamp(self.name, "frame", *a, *b)]])
        note = NOTES.get(group, NOTES.get(group.rstrip("0123456789"), ""))
        for i, words in enumerate(textwrap.wrap(note, max(30, int(width / 1.2)))):
            self.rows.append(["text", q(words), ["at", x + 1.27, y + height + 2.2 * (i + 1), 0],
                              ["effects", ["font", ["size", 1.27, 1.27]],
                               ["justify", "left", "bottom"]],
                              ["uuid", stamp(self.name, "note", group, i)]])
        self.rows.append(["text", q(title), ["at", x + 1.27, y - 0.635, 0],
                          ["effects", ["font", ["size", 2, 2]], ["justify", "left", "bottom"]],
                          ["uuid", stamp(self.name, "title", title, x, y)]])

    def place(self, part: Part, x: float, y: float) -> None:
        symbol = symbol_of(part.component)
        small = part.component.symbol in SMALL
        top = max((abs(s.y) for s in symbol.spots), default=0.0)
        up, down = (2.8, 3.0) if small else (top + 4.0, top + 4.2)
        about = about_part(part)
        self.rows.append([
            "symbol", ["lib_id", q(f"versavis:{symbol_name(part.component)}")], ["at", x, y, 0],
            ["unit", 1], ["in_bom", "yes"], ["on_board", "yes"],
            ["uuid", stamp(self.board.name, "symbol", part.ref)],
            ["property", q("Reference"), q(part.ref), ["id", 0], ["at", x, y - up, 0], font()],
            ["property", q("Value"), q(about), ["id", 1], ["at", x, y + down, 0], font(1.0)],
            ["property", q("Footprint"), q(f"versavis:{part.component.footprint}"), ["id", 2],
             ["at", x, y, 0], hidden()],
            ["property", q("Datasheet"), q(part.component.source), ["id", 3], ["at", x, y, 0],
             hidden()],
            ["property", q("MPN"), q(part.component.mpn), ["id", 4], ["at", x, y, 0], hidden()],
            *(["pin", q(s.pin.number), ["uuid", stamp(part.ref, "pin", s.pin.number)]]
              for s in symbol.spots)])
        for spot in symbol.spots:
            self.join(part, spot, x + spot.x, y - spot.y)

    def join(self, part: Part, spot: PinSpot, x: float, y: float) -> None:
        net = part.nets.get(spot.pin.number, "")
        key = (part.ref, spot.pin.number)
        if not net:
            if spot.pin.kind != "nc":  # those say so themselves
                self.rows.append(["no_connect", ["at", x, y], ["uuid", stamp(*key, "open")]])
            return
        out = -GRID if spot.side == "left" else GRID
        self.rows.append(["wire", ["pts", ["xy", x, y], ["xy", x + out, y]],
                          ["stroke", ["width", 0], ["type", "default"], ["color", 0, 0, 0, 0]],
                          ["uuid", stamp(*key, "wire")]])
        if net == "GND":
            self.ground(key, x + out, y, spot.side)
            return
        turn, justify = (180, "right") if spot.side == "left" else (0, "left")
        self.rows.append(["global_label", q(net), ["shape", "passive"], ["at", x + out, y, turn],
                          ["fields_autoplaced"],
                          ["effects", ["font", ["size", 1.1, 1.1]], ["justify", justify]],
                          ["uuid", stamp(*key, "label")]])

    def ground(self, key: tuple[str, str], x: float, y: float, side: str) -> None:
        self.grounds += 1
        turn = 270 if side == "left" else 90
        self.rows.append(power_symbol("GND", self.power_name(self.grounds), (x, y), turn,
                                      stamp(*key, "ground")))

    def power_name(self, number: int) -> str:
        return f"#PWR{self.page:02}{number:03}"

    def instances(self) -> list[Sexpr]:
        rows = [["path", q(f"{self.path}/{stamp(self.board.name, 'symbol', part.ref)}"),
                 ["reference", q(part.ref)], ["unit", 1], ["value", q(about_part(part))],
                 ["footprint", q(f"versavis:{part.component.footprint}")]] for part in self.parts]
        number = 0
        for part in self.parts:
            for spot in symbol_of(part.component).spots:
                if part.nets.get(spot.pin.number) == "GND":
                    number += 1
                    rows.append(["path", q(f"{self.path}/"
                                           f"{stamp(part.ref, spot.pin.number, 'ground')}"),
                                 ["reference", q(self.power_name(number))], ["unit", 1],
                                 ["value", q("GND")], ["footprint", q("")]])
        if self.page == 2:
            rows += [["path", q(f"{self.path}/{stamp(self.board.name, net, 'flag')}"),
                      ["reference", q(f"#FLG{i + 1:02}")], ["unit", 1], ["value", q("PWR_FLAG")],
                      ["footprint", q("")]] for i, net in enumerate(flagged(self.board))]
        return rows


def power_symbol(name: str, ref: str, place: tuple[float, float], turn: int, identity: str
                 ) -> Sexpr:
    texts = (("Reference", ref), ("Value", name), ("Footprint", ""), ("Datasheet", ""))
    return ["symbol", ["lib_id", q(f"versavis:{name}")], ["at", *place, turn], ["unit", 1],
            ["in_bom", "yes"], ["on_board", "yes"], ["uuid", identity],
            *(["property", q(key), q(value), ["id", i], ["at", *place, 0], hidden()]
              for i, (key, value) in enumerate(texts)),
            ["pin", q("1"), ["uuid", stamp(identity, "pin")]]]


def about_part(part: Part) -> str:
    """Its value, with what it is called on the board, and when it is not fitted."""
    about = part.value if not part.label else f"{part.value}: {part.label}"
    if "standard" in part.fitted:
        return about
    return about + (" (not fitted)" if part.fitted == {"none"} else
                    f" (variant {', '.join(sorted(part.fitted))})")


def flowed(sizes: list[tuple[float, float]], right: float) -> list[tuple[float, float]]:
    """Places of boxes side by side, in rows."""
    x, y, deepest = 17.78, 22.86, 22.86
    spots = []
    for width, height in sizes:
        if x + width > right and x > 20:
            x, y = 17.78, snap(deepest + 12.7)
        spots.append((x, y))
        deepest = max(deepest, y + height)
        x = snap(x + width + 7.62)
    return spots


def snap(value: float) -> float:
    return round(value / GRID) * GRID


def group_title(group: str) -> str:
    for start, title in (("camera", "Camera"), ("lidar", "LiDAR"),
                         ("isolated", "Isolated channel")):
        if group.startswith(start):
            return f"{title} {group.removeprefix(start)}"
    return group


def reach(part: Part, side: str) -> float:
    """Room that a symbol and the names on one side of it need."""
    symbol = symbol_of(part.component)
    names = [len(part.nets.get(s.pin.number, "")) for s in symbol.spots if s.side == side]
    return symbol.width / 2 + 2 * GRID + max(names, default=0) * 1.1 + 4.0


def tall(part: Part) -> float:
    symbol = symbol_of(part.component)
    return 10.16 if part.component.symbol in SMALL else symbol.height + 15.24


def arrange(parts: list[Part]) -> tuple[float, float, list[tuple[Part, tuple[float, float]]]]:
    """Chips and connectors in the first columns, two-pin parts in the others."""
    spots: list[tuple[Part, tuple[float, float]]] = []
    large = [part for part in parts if part.component.symbol not in SMALL]
    small = [part for part in parts if part.component.symbol in SMALL]
    limit = max(76.2, sum(map(tall, parts)) / max(1, round(sum(map(tall, parts)) / 95)) + 10)
    x, deepest = 2.54, 10.16
    for kind in (large, small):
        column: list[Part] = []
        for part in [*kind, None]:
            if part is None or (column and sum(map(tall, column)) + tall(part) > limit):
                if column:
                    left = max(reach(each, "left") for each in column)
                    y = 2.54
                    for each in column:
                        spots.append((each, (snap(x + left), snap(y + tall(each) / 2))))
                        y += tall(each)
                    deepest = max(deepest, y)
                    x = snap(x + left + max(reach(each, "right") for each in column) + 2.54)
                column = []
            if part is not None:
                column.append(part)
    return snap(x + 1.27), snap(deepest + 2.54), spots


def title_block(board: Board, title: str) -> Sexpr:
    return ["title_block", ["title", q(title)], ["company", q(board.title)],
            ["comment", 1, q("CERN-OHL-P-2.0. Generated: change hardware/board, not this file.")]]


def root(board: Board, sheets: list[Sheet]) -> str:
    rows: list[Sexpr] = []
    for i, sheet in enumerate(sheets):
        x, y = 38.1 + 76.2 * (i % 3), 38.1 + 33.02 * (i // 3)
        rows.append([
            "sheet", ["at", x, y], ["size", 60.96, 20.32], ["fields_autoplaced"],
            ["stroke", ["width", 0.1524], ["type", "solid"], ["color", 0, 0, 0, 0]],
            ["fill", ["color", 0, 0, 0, 0.0]], ["uuid", sheet.path[1:]],
            ["property", q("Sheet name"), q(sheet.title), ["id", 0], ["at", x, y - 0.7, 0],
             ["effects", ["font", ["size", 1.27, 1.27]], ["justify", "left", "bottom"]]],
            ["property", q("Sheet file"), q(f"{sheet.name}.kicad_sch"), ["id", 1],
             ["at", x, y + 20.9, 0],
             ["effects", ["font", ["size", 1.0, 1.0]], ["justify", "left", "top"]]]])
    return write([
        "kicad_sch", ["version", "20211123"], ["generator", "versavis"],
        ["uuid", stamp(board.name, "root")], ["paper", q("A4")], title_block(board, "all sheets"),
        ["lib_symbols"], *rows,
        ["sheet_instances", ["path", q("/"), ["page", q("1")]],
         *(["path", q(sheet.path), ["page", q(str(sheet.page))]] for sheet in sheets)],
        ["symbol_instances", *(row for sheet in sheets for row in sheet.instances())]]) + "\n"


def schematic(board: Board) -> dict[str, str]:
    """Text by file name."""
    sheets = [Sheet(board, name, title, i + 2) for i, (name, title) in enumerate(board.sheets)]
    files = {f"{sheet.name}.kicad_sch": sheet.draw() for sheet in sheets}
    return {f"{board.name}.kicad_sch": root(board, sheets), **files}
