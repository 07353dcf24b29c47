# SPDX-License-Identifier: BSD-3-Clause
"""Reads the written KiCad files again, and holds the net of each pin against the description: of
the board by its pads, of the sheets by where wires, labels and pins lie."""
from __future__ import annotations

from typing import Any

from footprints import ALL
from model import Board
from sexpr import read

Point = tuple[float, float]
Nets = dict[tuple[str, str], str]


def rows(node: list[Any], name: str) -> list[list[Any]]:
    return [each for each in node if isinstance(each, list) and each and each[0] == name]


def row(node: list[Any], name: str) -> list[Any]:
    return rows(node, name)[0]


def property_of(node: list[Any], name: str) -> str:
    return next(str(each[2]) for each in rows(node, "property") if each[1] == name)


def point(x: Any, y: Any) -> Point:
    return round(float(x), 2), round(float(y), 2)


def board_nets(text: str) -> Nets:
    found = {}
    for footprint in rows(read(text), "footprint"):
        ref = next(str(each[2]) for each in rows(footprint, "fp_text") if each[1] == "reference")
        for pad in rows(footprint, "pad"):
            net = rows(pad, "net")
            if net and not str(net[0][2]).startswith("unconnected-"):
                found[ref, str(pad[1])] = str(net[0][2])
    return found


def library_pins(sheet: list[Any]) -> dict[str, list[tuple[str, float, float]]]:
    found = {}
    for symbol in rows(row(sheet, "lib_symbols"), "symbol"):
        pins = [pin for unit in rows(symbol, "symbol") for pin in rows(unit, "pin")]
        found[str(symbol[1])] = [(str(row(pin, "number")[1]), float(row(pin, "at")[1]),
                                  float(row(pin, "at")[2])) for pin in pins]
    return found


def sheet_nets(text: str) -> Nets:
    """A pin's wire begins at the pin; at its other end is a label, or the symbol of ground."""
    sheet = read(text)
    library = library_pins(sheet)
    wires: dict[Point, Point] = {}
    for wire in rows(sheet, "wire"):
        first, last = (point(*xy[1:]) for xy in rows(row(wire, "pts"), "xy"))
        wires[first] = last
    names = {point(*row(label, "at")[1:3]): str(label[1]) for label in rows(sheet, "global_label")}
    symbols = rows(sheet, "symbol")
    for symbol in symbols:
        if row(symbol, "lib_id")[1] == "versavis:GND":
            names[point(*row(symbol, "at")[1:3])] = "GND"
    found = {}
    for symbol in symbols:
        ref, kind = property_of(symbol, "Reference"), str(row(symbol, "lib_id")[1])
        if ref.startswith("#"):
            continue
        x, y = (float(value) for value in row(symbol, "at")[1:3])
        for number, dx, dy in library[kind]:
            end = wires.get(point(x + dx, y - dy))
            if end in names:
                found[ref, number] = names[end]
    return found


def faults(board: Board, files: dict[str, str]) -> list[str]:
    wanted = {(part.ref, number): net for part in board.parts.values()
              for number, net in part.nets.items()}
    sheets: Nets = {}
    for name, text in files.items():
        if name.endswith(".kicad_sch") and name != f"{board.name}.kicad_sch":
            sheets |= sheet_nets(text)
    wrong = compare(wanted, sheets, "the sheets")
    pads = {pad.number for part in board.parts.values()
            for pad in ALL[part.component.footprint].pads}
    on_board = {key: net for key, net in wanted.items() if key[1] in pads}
    return wrong + compare(on_board, board_nets(files[f"{board.name}.kicad_pcb"]), "the board")


def compare(wanted: Nets, found: Nets, where: str) -> list[str]:
    return [f"{ref} pin {number} is at {wanted.get((ref, number))}, in {where} at "
            f"{found.get((ref, number))}" for ref, number in sorted({*wanted, *found})
            if wanted.get((ref, number)) != found.get((ref, number))]
